//! What is drawn of several nodes, as one mesh that knows whose each triangle is.

use gigalod_format::FormatError;
use gigalod_format::hybrid::{HybridFile, NodeId, NodeRecord, Page, Skeleton};
use gigalod_reference::{Bvh, Mesh};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Places of a page's vertices and points; model space.
pub(super) fn places(page: &Page, record: &NodeRecord, skeleton: &Skeleton) -> Vec<DVec3> {
    let step = skeleton.step(record.level);
    let least = DVec3::from_array(record.min_steps.map(f64::from));
    let place = |at: &[u16; 3]| skeleton.root().origin + (least + DVec3::from_array(at.map(f64::from))) * step;
    page.positions.iter().map(place).collect()
}

/// Smallest and largest corner of a node's box; model space.
pub(super) fn box_of(record: &NodeRecord, skeleton: &Skeleton) -> [DVec3; 2] {
    let step = skeleton.step(record.level);
    let least = DVec3::from_array(record.min_steps.map(f64::from));
    [least, least + DVec3::from_array(record.extent_steps.map(f64::from))]
        .map(|steps| skeleton.root().origin + steps * step)
}

/// Triangles of several nodes, and their points as triangles without a size.
pub(super) struct Cut {
    surface: Owned,
    points: Owned,
}

/// A mesh whose triangles are those of one node after the other.
struct Owned {
    mesh: Mesh,
    /// Number of each node's first triangle, and how far beyond itself what is there reaches.
    nodes: Vec<(u32, NodeId, f64)>,
}

/// Pages that are decoded side by side.
const AT_ONCE: usize = 64;

impl Cut {
    /// # Errors
    /// A page cannot be read.
    pub(super) fn of(file: &HybridFile, nodes: &[NodeId]) -> Result<Self, FormatError> {
        let skeleton = file.skeleton();
        let (mut surface, mut points) = (Parts::default(), Parts::default());
        for some in nodes.chunks(AT_ONCE) {
            let pages: Vec<Page> = some.par_iter().map(|node| file.read_page(*node)).collect::<Result<_, _>>()?;
            for (node, page) in some.iter().zip(&pages) {
                let record = skeleton.record(*node);
                let at = places(page, record, skeleton);
                let (vertices, dots) = at.split_at(record.vertices as usize);
                surface.add(*node, 0.0, vertices, &page.triangles);
                // The ball that is drawn.
                let reach = f64::from(record.spacing) * 0.5;
                let each: Vec<[u32; 3]> = (0..dots.len() as u32).map(|dot| [dot; 3]).collect();
                points.add(*node, reach, dots, &each);
            }
        }
        Ok(Self { surface: surface.finish(), points: points.finish() })
    }

    pub(super) fn near(&self) -> Near<'_> {
        Near { cut: self, surface: Bvh::build(&self.surface.mesh), points: Bvh::build(&self.points.mesh) }
    }
}

#[derive(Default)]
struct Parts {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    nodes: Vec<(u32, NodeId, f64)>,
}

impl Parts {
    fn add(&mut self, node: NodeId, reach: f64, positions: &[DVec3], triangles: &[[u32; 3]]) {
        let first = self.positions.len() as u32;
        if !triangles.is_empty() {
            self.nodes.push((self.triangles.len() as u32, node, reach));
        }
        self.positions.extend(positions);
        self.triangles.extend(triangles.iter().map(|corners| corners.map(|corner| first + corner)));
    }

    fn finish(self) -> Owned {
        // Nobody asks for them, and to have them computed would take long.
        let normals = vec![Vec3::ZERO; self.positions.len()];
        let mesh = Mesh::new(self.positions, Some(normals), None, self.triangles);
        Owned { mesh: mesh.expect("decoded pages are sound, and at finite places"), nodes: self.nodes }
    }
}

impl Owned {
    fn near(&self, bvh: &Bvh<'_>, at: DVec3, last: &mut Option<u32>, enough: f64) -> Option<(f64, NodeId)> {
        let found = bvh.near_point(at, *last, enough)?;
        *last = Some(found.triangle);
        let after = self.nodes.partition_point(|(first, ..)| *first <= found.triangle);
        let (_, node, reach) = self.nodes[after - 1];
        Some(((found.distance - reach).max(0.0), node))
    }
}

/// Finds what of a cut is nearest.
pub(super) struct Near<'a> {
    cut: &'a Cut,
    surface: Bvh<'a>,
    points: Bvh<'a>,
}

/// What was near the last place: of the surface, and of points. Places that follow each other lie side by side.
#[derive(Default)]
pub(super) struct Last {
    surface: Option<u32>,
    points: Option<u32>,
}

impl Near<'_> {
    /// Distance of a triangle or point that is nearer than `enough`, or else of the nearest, and its node; `None` where there is nothing
    /// at all.
    pub(super) fn near(&self, at: DVec3, last: &mut Last, enough: f64) -> Option<(f64, NodeId)> {
        let on_surface = self.cut.surface.near(&self.surface, at, &mut last.surface, enough);
        if on_surface.is_some_and(|(distance, _)| distance < enough) {
            return on_surface;
        }
        let at_point = self.cut.points.near(&self.points, at, &mut last.points, enough);
        match (on_surface, at_point) {
            (Some(surface), Some(point)) if point.0 < surface.0 => Some(point),
            (surface, point) => surface.or(point),
        }
    }
}
