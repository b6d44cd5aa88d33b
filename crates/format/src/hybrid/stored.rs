//! The skeleton's bytes: 112 of the root, 44 for each node, then the model.
//!
//! Level and first child are not stored: nodes stand level by level, children in the order of their parents, so they follow from the
//! numbers of children. Places are relative to the parent's. Errors, spacing and cone are rounded, never to less.
//!
//! What always holds of what was parsed: every node but the root is the child of exactly one before it; errors never rise from parent to
//! child; numbers are finite and in their ranges; pages lie within the file and have bytes in proportion to what they hold.

use super::codec::Model;
use super::skeleton::{NodeRecord, Root, Skeleton};
use crate::FormatError;
use crate::bytes::Fields;
use gigalod_geom::Aabb;
use gigalod_geom::camera::UpAxis;
use glam::{DVec3, Vec3};

/// Most vertices of a page.
pub const MAX_VERTICES: u32 = 1 << 20;
/// Most points of a page.
pub const MAX_POINTS: u32 = 1 << 20;
/// Most triangles of a page.
pub const MAX_TRIANGLES: u32 = 1 << 22;
/// Most borders of a page.
pub const MAX_BORDERS: u32 = 3 << 22;
/// Most levels.
pub const MAX_LEVELS: u32 = 32;
/// A page has at least a byte for so many vertices, triangles and points, so that a small file does not ask for much memory.
pub(super) const MOST_PER_BYTE: u64 = 256;

const ROOT_BYTES: usize = 112;
const RECORD_BYTES: usize = 44;
const PRESERVES_APPEARANCE: u8 = 1;
const HAS_COLORS: u8 = 2;
const CLOSED: u8 = 4;
const Z_UP: u8 = 8;
/// Places are stored as differences to twice the parent's place, with this added, in as many bits.
const PLACE_OFFSET: i64 = 1 << 16;
const PLACE_BITS: u32 = 18;

/// An `f32` ≥ 0 without its last eight bits, rounded up.
fn short(number: f32) -> u32 {
    number.to_bits().div_ceil(256)
}

fn long(short: u32) -> f32 {
    f32::from_bits(short << 8)
}

/// The smallest share of 255 of a total that is no less than a part of it.
fn share(part: f32, total: f32) -> u8 {
    (0..=255u8).find(|share| part_of(*share, total) >= part).unwrap_or(255)
}

fn part_of(share: u8, total: f32) -> f32 {
    (f64::from(total) * f64::from(share) / 255.0) as f32
}

/// An axis as two coordinates on the octahedron.
fn axis_code(axis: Vec3) -> [u8; 2] {
    let sum = axis.x.abs() + axis.y.abs() + axis.z.abs();
    let (x, y) = if sum > 0.0 { (axis.x / sum, axis.y / sum) } else { (0.0, 0.0) };
    let folded = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
    let (x, y) = if axis.z < 0.0 { folded } else { (x, y) };
    [x, y].map(|coordinate| ((coordinate * 0.5 + 0.5) * 255.0).round() as u8)
}

fn axis_of([u, v]: [u8; 2]) -> Vec3 {
    let [x, y] = [u, v].map(|code| f32::from(code) / 255.0 * 2.0 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let folded = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
    let (x, y) = if z < 0.0 { folded } else { (x, y) };
    Vec3::new(x, y, z).normalize()
}

/// The sine of a cone around the stored axis that holds one around the true axis; 255: every direction.
fn sine_code(axis: Vec3, sine: f32, stored: Vec3) -> u8 {
    let length = axis.length();
    if !(0.0..1.0).contains(&sine) || !length.is_normal() {
        return 255;
    }
    let cosine = (1.0 - sine * sine).sqrt();
    let (apart_cosine, apart_sine) = (axis.dot(stored) / length, axis.cross(stored).length() / length);
    let wider = sine * apart_cosine + cosine * apart_sine;
    if cosine * apart_cosine - sine * apart_sine <= 0.0 { 255 } else { (wider * 255.0 + 0.01).ceil() as u8 }
}

impl NodeRecord {
    /// As it will be when it was written and parsed: errors, spacing and cone are rounded, never to less.
    #[must_use]
    pub fn as_stored(&self) -> Self {
        let error_total = long(short(self.error_total));
        let axis = Vec3::from_array(self.cone_axis);
        let stored = axis_of(axis_code(axis));
        Self {
            error_total,
            error_geo: part_of(share(self.error_geo, error_total), error_total),
            cone_axis: stored.to_array(),
            cone_sine: f32::from(sine_code(axis, self.cone_sine, stored)) / 255.0,
            spacing: long(short(self.spacing)),
            ..*self
        }
    }

    /// `parent_place` is twice the parent's.
    fn put(&self, number: usize, parent_place: [i64; 3], out: &mut Vec<u8>) {
        let mut packed = u64::from(self.children) << (3 * PLACE_BITS);
        for (axis, parent) in parent_place.into_iter().enumerate() {
            let mut place = i64::from(self.min_steps[axis]) - parent + PLACE_OFFSET;
            if self.vertices + self.points == 0 {
                place = place.clamp(0, (1 << PLACE_BITS) - 1);
            }
            assert!(
                place >> PLACE_BITS == 0,
                "node {number} is {place} steps from its parent's place less {PLACE_OFFSET}"
            );
            packed |= (place as u64) << (axis as u32 * PLACE_BITS);
        }
        let stored = self.as_stored();
        let axis = Vec3::from_array(self.cone_axis);
        let code = axis_code(axis);
        out.extend(packed.to_le_bytes());
        out.extend(self.extent_steps.iter().flat_map(|x| x.to_le_bytes()));
        out.extend(code);
        out.extend([sine_code(axis, self.cone_sine, axis_of(code)), share(self.error_geo, stored.error_total)]);
        let counts = [self.vertices, self.triangles, self.points, self.borders];
        for number in [short(self.error_total), short(self.spacing)].into_iter().chain(counts) {
            out.extend(&number.to_le_bytes()[..3]);
        }
        out.extend([self.bytes, self.checksum].iter().flat_map(|x| x.to_le_bytes()));
    }

    /// Undoes [`Self::put`]; places are relative to the parent still.
    fn take(record: &[u8]) -> (Self, [i64; 3]) {
        let mut fields = Fields(record);
        let packed = fields.u64();
        let place =
            [0, 1, 2].map(|axis| (packed >> (axis * PLACE_BITS) & ((1 << PLACE_BITS) - 1)) as i64 - PLACE_OFFSET);
        let extent_steps = [(); 3].map(|()| fields.u16());
        let cone_axis = axis_of([fields.u8(), fields.u8()]).to_array();
        let (sine, share) = (fields.u8(), fields.u8());
        let mut three = || u32::from(fields.u16()) | u32::from(fields.u8()) << 16;
        let error_total = long(three());
        let record = Self {
            level: 0,
            first_child: 0,
            // The rest of the word must be 0, so no more than this is a number of children.
            children: u32::try_from(packed >> (3 * PLACE_BITS)).unwrap_or(u32::MAX),
            min_steps: [0; 3],
            extent_steps,
            error_geo: part_of(share, error_total),
            error_total,
            cone_axis,
            cone_sine: f32::from(sine) / 255.0,
            spacing: long(three()),
            vertices: three(),
            triangles: three(),
            points: three(),
            borders: three(),
            bytes: fields.u32(),
            checksum: fields.u32(),
        };
        (record, place)
    }

    /// What is wrong with its numbers, apart from all others.
    fn problem(&self) -> Option<String> {
        let in_range = |number: f32| (0.0..=f32::MAX).contains(&number);
        if !in_range(self.error_total) || !in_range(self.spacing) {
            let (error, spacing) = (self.error_total, self.spacing);
            return Some(format!("an error of {error} and a spacing of {spacing}, expected finite numbers ≥ 0"));
        }
        if self.points == 0 && self.spacing != 0.0 {
            return Some(format!("a spacing of {}, expected 0 where there are no points", self.spacing));
        }
        let counts = [self.vertices, self.triangles, self.points, self.borders];
        let most = [MAX_VERTICES, MAX_TRIANGLES, MAX_POINTS, MAX_BORDERS.min(3 * self.triangles.min(MAX_TRIANGLES))];
        if counts.iter().zip(most).any(|(count, most)| *count > most) || (self.triangles > 0 && self.vertices == 0) {
            return Some(format!("{counts:?} vertices, triangles, points and borders, expected at most {most:?}"));
        }
        let held = u64::from(self.vertices) + u64::from(self.triangles) + u64::from(self.points);
        if held > MOST_PER_BYTE * u64::from(self.bytes) {
            let bytes = self.bytes;
            return Some(format!(
                "{held} vertices, triangles and points in {bytes} bytes, expected at most {MOST_PER_BYTE} a byte"
            ));
        }
        None
    }
}

impl Skeleton {
    /// Length on disk of the skeleton of so many nodes, with its model.
    pub fn encoded_bytes(nodes: u64, model: &Model) -> u64 {
        ROOT_BYTES as u64 + nodes * RECORD_BYTES as u64 + model.to_bytes().len() as u64
    }

    /// Its bytes on disk; `model` is what coded the pages.
    ///
    /// # Panics
    /// When nodes do not stand level by level, with children side by side in the order of their parents, or a node lies far from
    /// its parent.
    pub fn encode(root: &Root, nodes: &[NodeRecord], model: &Model) -> Vec<u8> {
        let model = model.to_bytes();
        let mut out = Vec::with_capacity(ROOT_BYTES + RECORD_BYTES * nodes.len() + model.len());
        out.extend(root.origin.to_array().iter().flat_map(|x| x.to_le_bytes()));
        out.extend(root.edge.to_le_bytes());
        out.extend([root.bounds.min, root.bounds.max].iter().flat_map(DVec3::to_array).flat_map(f64::to_le_bytes));
        out.extend([root.nodes, root.leaves].iter().flat_map(|x| x.to_le_bytes()));
        out.extend(root.levels.to_le_bytes());
        let flag = |set: bool, bit: u8| if set { bit } else { 0 };
        let flags = flag(root.preserves_appearance, PRESERVES_APPEARANCE)
            | flag(root.has_colors, HAS_COLORS)
            | flag(root.closed, CLOSED)
            | flag(root.up == UpAxis::Z, Z_UP);
        out.extend([root.cell_bits as u8, root.normal_bits as u8, flags, 0]);
        out.extend([root.resolution, model.len() as u32].iter().flat_map(|x| x.to_le_bytes()));
        debug_assert_eq!(out.len(), ROOT_BYTES);
        let mut parents = vec![[0; 3]; 1.min(nodes.len())];
        for (number, node) in nodes.iter().enumerate() {
            let parent_place = *parents.get(number).expect("every node has a parent before it");
            let place = node.min_steps.map(i64::from);
            assert!(node.children == 0 || node.first_child as usize == parents.len(), "children of node {number}");
            parents.extend((0..node.children).map(|_| place.map(|steps| 2 * steps)));
            node.put(number, parent_place, &mut out);
        }
        assert_eq!(parents.len(), nodes.len(), "children of all nodes");
        out.extend(model);
        out
    }

    /// Checks and decodes a skeleton.
    ///
    /// # Errors
    /// [`FormatError::Invalid`] naming the record, and [`FormatError::Truncated`] where pages end beyond the file.
    pub fn parse(bytes: &[u8], pages_offset: u64, file_bytes: u64) -> Result<Self, FormatError> {
        let invalid = |problem: String| FormatError::invalid("the skeleton", problem);
        if bytes.len() < ROOT_BYTES {
            return Err(invalid(format!("{} bytes, expected at least {ROOT_BYTES}", bytes.len())));
        }
        let (root_bytes, rest) = bytes.split_at(ROOT_BYTES);
        let (root, model_bytes) = parse_root(root_bytes)?;
        let expected = u128::from(root.nodes) * RECORD_BYTES as u128 + u128::from(model_bytes);
        if root.nodes == 0 || expected != rest.len() as u128 {
            let (nodes, found) = (root.nodes, bytes.len());
            return Err(invalid(format!(
                "{nodes} nodes and {model_bytes} bytes of model in {found} bytes of skeleton"
            )));
        }
        let (records, model) = rest.split_at(rest.len() - model_bytes as usize);
        let nodes = parse_nodes(records)?;
        let leaves = nodes.iter().filter(|node| node.children == 0).count() as u64;
        let levels = nodes.last().map_or(0, |node| node.level + 1);
        if (leaves, levels) != (root.leaves, root.levels) {
            let (found, on) = (root.leaves, root.levels);
            return Err(invalid(format!("{found} leaves on {on} levels, expected {leaves} on {levels}")));
        }
        let end = nodes.iter().fold(pages_offset, |sum, node| sum.saturating_add(u64::from(node.bytes)));
        if end > file_bytes {
            return Err(FormatError::Truncated { what: "the last page".into(), end, file_bytes });
        }
        Ok(Self::new(root, nodes, pages_offset).with_model(Model::parse(model)?))
    }
}

/// The root and the length of the model.
fn parse_root(bytes: &[u8]) -> Result<(Root, u32), FormatError> {
    let invalid = |problem: String| FormatError::invalid("the skeleton", problem);
    let mut fields = Fields(bytes);
    let vector = |fields: &mut Fields<'_>| DVec3::new(fields.f64(), fields.f64(), fields.f64());
    let (origin, edge) = (vector(&mut fields), fields.f64());
    let bounds = Aabb { min: vector(&mut fields), max: vector(&mut fields) };
    let (nodes, leaves, levels) = (fields.u64(), fields.u64(), fields.u32());
    let (cell_bits, normal_bits, flags, _) = (u32::from(fields.u8()), u32::from(fields.u8()), fields.u8(), fields.u8());
    let (resolution, model_bytes) = (fields.u32(), fields.u32());
    let finite = origin.is_finite() && bounds.min.is_finite() && bounds.max.is_finite();
    if !finite || bounds.is_empty() || !(edge > 0.0 && edge <= f64::MAX) {
        return Err(invalid(format!(
            "a cell of {edge} at {origin} and bounds from {} to {}, expected finite numbers, an edge > 0, the smaller first",
            bounds.min, bounds.max
        )));
    }
    if !(4..=14).contains(&cell_bits) || !(6..=12).contains(&normal_bits) || resolution == 0 {
        return Err(invalid(format!(
            "{cell_bits} bits of cells, {normal_bits} of normals, a resolution of {resolution}, expected 4–14, 6–12, at least 1"
        )));
    }
    let known = PRESERVES_APPEARANCE | HAS_COLORS | CLOSED | Z_UP;
    if flags & !known != 0 {
        return Err(invalid(format!("flags {flags:#x}, expected none beyond {known:#x}")));
    }
    let root = Root {
        origin,
        edge,
        bounds,
        cell_bits,
        normal_bits,
        resolution,
        nodes,
        leaves,
        levels,
        preserves_appearance: flags & PRESERVES_APPEARANCE != 0,
        has_colors: flags & HAS_COLORS != 0,
        closed: flags & CLOSED != 0,
        up: if flags & Z_UP != 0 { UpAxis::Z } else { UpAxis::Y },
    };
    Ok((root, model_bytes))
}

fn parse_nodes(records: &[u8]) -> Result<Vec<NodeRecord>, FormatError> {
    let count = records.len() / RECORD_BYTES;
    let mut nodes: Vec<NodeRecord> = Vec::with_capacity(count);
    // The parent of the next node, which has children, and how many of these are still to come.
    let (mut parent, mut next_child) = (0, 1);
    for (number, record) in records.chunks_exact(RECORD_BYTES).enumerate() {
        let invalid = |problem: String| FormatError::invalid(format!("the record of node {number}"), problem);
        let (mut node, place) = NodeRecord::take(record);
        let mut places = [0; 3];
        if number > 0 {
            while parent < number && nodes[parent].first_child + nodes[parent].children <= number as u32 {
                parent += 1;
            }
            let Some(above) = nodes.get(parent) else {
                return Err(invalid("a child of none, expected nodes before it to have more children".into()));
            };
            if node.error_total > above.error_total {
                let (found, most) = (node.error_total, above.error_total);
                return Err(invalid(format!("an error of {found}, expected at most its parent's {most}")));
            }
            node.level = above.level + 1;
            if node.level >= MAX_LEVELS {
                return Err(invalid(format!("level {}, expected less than {MAX_LEVELS}", node.level)));
            }
            places = above.min_steps.map(|steps| 2 * i64::from(steps));
        }
        for axis in 0..3 {
            let steps = places[axis] + place[axis];
            node.min_steps[axis] = i32::try_from(steps)
                .map_err(|_| invalid(format!("{steps} steps from the origin, expected 32 bits")))?;
        }
        if node.children > 8 || node.children as usize > count - next_child {
            let (found, left) = (node.children, count - next_child);
            return Err(invalid(format!("{found} children, expected at most 8, and {left} that are left")));
        }
        node.first_child = next_child as u32;
        next_child += node.children as usize;
        if let Some(problem) = node.problem() {
            return Err(invalid(problem));
        }
        nodes.push(node);
    }
    if next_child != count {
        let problem = format!("nodes with {} children in all, expected {}", next_child - 1, count - 1);
        return Err(FormatError::invalid("the skeleton", problem));
    }
    Ok(nodes)
}
