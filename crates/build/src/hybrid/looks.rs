//! How far what looks alike has moved: the appearance error of the hybrid paper, section 3.1.
//!
//! A vertex that vanishes becomes a *sample*: it lies on one of the faces that are left and remembers how it looked. Its error is the
//! way along the surface to where the interpolated normal is its own: the angle between both, divided by the largest curvature of the face,
//! which is what its corners' normals say. The same for colours. Not a bound: an estimate, as the paper has it.
//!
//! Differs: what nobody sees is no error (an angle or a difference of colours below a threshold); samples are held against the original of
//! this node, not against what the last operation left, so that errors of one level do not add up.

use super::patch::Vertex;
use glam::{DVec3, Vec3};

/// End of a list.
const END: u32 = u32::MAX;
/// Radians: at most three of 255 grey levels under the steepest light.
const UNSEEN_ANGLE: f32 = 0.012;
/// Of 255.
const UNSEEN_COLOR: f32 = 3.0;

/// A vertex that there was.
#[derive(Clone, Copy, Debug)]
struct Sample {
    was: Vertex,
    /// Error that it had when this level began.
    base: f32,
    next: u32,
}

/// All samples, in lists by the face that they lie on.
#[derive(Debug, Default)]
pub(super) struct Looks {
    samples: Vec<Sample>,
    heads: Vec<u32>,
}

/// How a face looks: its corners, and how fast that changes on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaceLook {
    normals: [Vec3; 3],
    colors: [Vec3; 3],
    /// Radians a length.
    curvature: f32,
    /// Levels a length.
    gradient: f32,
}

impl FaceLook {
    pub(super) fn of(corners: [&Vertex; 3]) -> Self {
        let mut look = Self {
            normals: corners.map(|corner| corner.normal),
            colors: corners.map(|corner| corner.color),
            curvature: 0.0,
            gradient: 0.0,
        };
        for [a, b] in [[0, 1], [0, 2], [1, 2]] {
            let length = (corners[a].at - corners[b].at).length() as f32;
            let per_length = 1.0 / length.max(f32::MIN_POSITIVE);
            look.curvature = look.curvature.max((look.normals[a] - look.normals[b]).length() * per_length);
            look.gradient = look.gradient.max((look.colors[a] - look.colors[b]).length() * per_length);
        }
        look
    }

    /// How far what looks like `was` is, on this face, from the place with these shares of its corners.
    fn error(&self, was: &Vertex, shares: [f64; 3]) -> f32 {
        let [a, b, c] = shares.map(|share| share as f32);
        let mix = |of: &[Vec3; 3]| of[0] * a + of[1] * b + of[2] * c;
        let angle = (mix(&self.normals).normalize_or_zero() - was.normal).length() - UNSEEN_ANGLE;
        let color = (mix(&self.colors) - was.color).length() - UNSEEN_COLOR;
        let away = |difference: f32, rate: f32| if difference <= 0.0 { 0.0 } else { difference / rate };
        away(angle, self.curvature).max(away(color, self.gradient))
    }
}

impl Looks {
    pub(super) fn new(faces: usize) -> Self {
        Self { samples: Vec::new(), heads: vec![END; faces] }
    }

    /// Samples on a face.
    pub(super) fn on(&self, face: u32, out: &mut Vec<u32>) {
        let mut sample = self.heads[face as usize];
        while sample != END {
            out.push(sample);
            sample = self.samples[sample as usize].next;
        }
    }

    pub(super) fn place(&self, sample: u32) -> DVec3 {
        self.samples[sample as usize].was.at
    }

    /// Error of a sample on a face.
    pub(super) fn error(&self, sample: u32, look: &FaceLook, shares: [f64; 3]) -> f32 {
        let Sample { was, base, .. } = &self.samples[sample as usize];
        base + look.error(was, shares)
    }

    /// Error of a vertex that would become a sample.
    pub(super) fn error_of_vertex(was: &Vertex, base: f32, look: &FaceLook, shares: [f64; 3]) -> f32 {
        base + look.error(was, shares)
    }

    /// A vertex vanishes.
    pub(super) fn add(&mut self, was: Vertex, base: f32, face: u32) {
        self.samples.push(Sample { was, base, next: self.heads[face as usize] });
        self.heads[face as usize] = self.samples.len() as u32 - 1;
    }

    /// Nothing lies on a face any more.
    pub(super) fn clear(&mut self, face: u32) {
        self.heads[face as usize] = END;
    }

    pub(super) fn put(&mut self, sample: u32, face: u32) {
        self.samples[sample as usize].next = self.heads[face as usize];
        self.heads[face as usize] = sample;
    }
}
