//! What the nodes of a tree are like: each node's ball, normal, cone and colour, measured against all units below it.
//!
//! Units go in, in the order of the tree, and which ranges of them the nodes are; [`Measured`] nodes come out. A unit is a leaf; in
//! the tree on top of all chunks it is a chunk's root.
//!
//! Better than the paper, which makes a node's ball and cone from its children's: what is lost there at each level adds up, to
//! three times the area and to cones that hold nearly everything after five levels. Measured against the units nothing adds
//! up. Means are weighted by the number of leaves, so a lone vertex does not outweigh a hundred others; colours are averaged in
//! linear light.
//!
//! What always holds: a node's ball encloses those of its units, and its cone their cones.

use bytemuck::{Pod, Zeroable};
use gigalod_geom::Sphere;
use gigalod_geom::quantise::normal;
use glam::Vec3;

/// A unit of a tree, or a node of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub(super) sphere: Sphere,
    /// Code of the normal as stored.
    pub(super) normal: u16,
    /// A lower bound of the cosine of its cone's half-angle.
    pub(super) cos_spread: f32,
    pub(super) sums: Sums,
}

/// What adds up over the leaves below a node.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Sums {
    /// Around the units' balls.
    min: [f32; 3],
    max: [f32; 3],
    /// Of the leaves' unit normals.
    normal: [f32; 3],
    /// Of the leaves' colours, in linear light.
    color: [f32; 3],
    /// Of the leaves' radii.
    radius: f32,
    /// Leaves.
    pub(super) weight: u32,
}

impl Sums {
    pub(super) const NOTHING: Self = Self {
        min: [f32::INFINITY; 3],
        max: [f32::NEG_INFINITY; 3],
        normal: [0.0; 3],
        color: [0.0; 3],
        radius: 0.0,
        weight: 0,
    };

    pub(super) fn of_leaf(sphere: &Sphere, normal: Vec3, color: Vec3) -> Self {
        let (min, max) = (sphere.center - sphere.radius, sphere.center + sphere.radius);
        Self {
            min: min.to_array(),
            max: max.to_array(),
            normal: normal.to_array(),
            color: color.to_array(),
            radius: sphere.radius,
            weight: 1,
        }
    }

    pub(super) fn and(&self, other: &Self) -> Self {
        let both = |a: [f32; 3], b: [f32; 3], f: fn(f32, f32) -> f32| std::array::from_fn(|axis| f(a[axis], b[axis]));
        Self {
            min: both(self.min, other.min, f32::min),
            max: both(self.max, other.max, f32::max),
            normal: both(self.normal, other.normal, |a, b| a + b),
            color: both(self.color, other.color, |a, b| a + b),
            radius: self.radius + other.radius,
            weight: self.weight + other.weight,
        }
    }

    pub(super) fn mean_radius(&self) -> f32 {
        self.radius / self.weight.max(1) as f32
    }

    /// In linear light.
    pub(super) fn mean_color(&self) -> Vec3 {
        Vec3::from_array(self.color) / self.weight.max(1) as f32
    }
}

/// All units of a tree, an array for each of their numbers, so that a range of them is measured four or more at a time.
#[derive(Debug, Default)]
pub(super) struct Units {
    center: [Vec<f32>; 3],
    radius: Vec<f32>,
    axis: [Vec<f32>; 3],
    cos: Vec<f32>,
    sin: Vec<f32>,
}

/// Units that are measured side by side.
const LANES: usize = 8;

impl Units {
    pub(super) fn clear(&mut self) {
        let Self { center, radius, axis, cos, sin } = self;
        center.iter_mut().chain(axis).chain([radius, cos, sin]).for_each(Vec::clear);
    }

    pub(super) fn push(&mut self, sphere: &Sphere, axis: Vec3, cos_spread: f32) {
        for (values, value) in self.center.iter_mut().zip(sphere.center.to_array()) {
            values.push(value);
        }
        for (values, value) in self.axis.iter_mut().zip(axis.to_array()) {
            values.push(value);
        }
        self.radius.push(sphere.radius);
        // A half-space and more counts as every direction.
        let narrow = cos_spread > 0.0;
        self.cos.push(if narrow { cos_spread } else { -1.0 });
        self.sin.push(if narrow { sine(cos_spread) } else { 0.0 });
    }

    /// The node over `range`, not empty, whose sums are known.
    pub(super) fn node(&self, range: std::ops::Range<usize>, sums: Sums) -> Measured {
        let first = normal_at(&self.axis, range.start);
        let mean = Vec3::from_array(sums.normal);
        let direction = if mean == Vec3::ZERO { first } else { mean };
        let code = normal::encode(direction);
        let center = (Vec3::from_array(sums.min) + Vec3::from_array(sums.max)) * 0.5;
        let radius = self.reach(range.clone(), center);
        let cos_spread = self.spread(range, normal::decode(code));
        Measured { sphere: Sphere { center, radius }, normal: code, cos_spread, sums }
    }

    /// Radius of the smallest ball at `center` that encloses the balls of a range, rounded up.
    fn reach(&self, range: std::ops::Range<usize>, center: Vec3) -> f32 {
        let [x, y, z] = self.center.each_ref().map(|values| &values[range.clone()]);
        let radius = &self.radius[range];
        let mut widest = [0.0_f32; LANES];
        let far = |x: f32, y: f32, z: f32, radius: f32| {
            let (x, y, z) = (x - center.x, y - center.y, z - center.z);
            (x * x + y * y + z * z).sqrt() + radius
        };
        let whole = radius.len() / LANES * LANES;
        for at in (0..whole).step_by(LANES) {
            let lanes = |values: &[f32]| -> [f32; LANES] { values[at..at + LANES].try_into().expect("as many") };
            let (x, y, z, radius) = (lanes(x), lanes(y), lanes(z), lanes(radius));
            for lane in 0..LANES {
                let far = far(x[lane], y[lane], z[lane], radius[lane]);
                widest[lane] = if far > widest[lane] { far } else { widest[lane] };
            }
        }
        for at in whole..radius.len() {
            widest[0] = widest[0].max(far(x[at], y[at], z[at], radius[at]));
        }
        let widest = widest.into_iter().fold(0.0_f32, f32::max);
        // Differences, squares, two sums, a root and a sum: below six half steps of f32 in all, and one more for this product.
        if widest > 0.0 { (widest * (1.0 + 6e-7)).next_up() } else { 0.0 }
    }

    /// A lower bound of the cosine of the half-angle of the cone around `axis` that holds the cones of a range; −1 where there is none.
    fn spread(&self, range: std::ops::Range<usize>, axis: Vec3) -> f32 {
        let [x, y, z] = self.axis.each_ref().map(|values| &values[range.clone()]);
        let (cos, sin) = (&self.cos[range.clone()], &self.sin[range]);
        let mut least = [1.0_f32; LANES];
        // cos(α + β); where α + β passes 180°, and so cos α < −cos β, −1.
        let sum = |x: f32, y: f32, z: f32, cos: f32, sin: f32| {
            let along = (axis.x * x + axis.y * y + axis.z * z).clamp(-1.0, 1.0);
            let sum = along * cos - sine(along) * sin;
            if cos < 0.0 || along < -cos { -1.0 } else { sum }
        };
        let whole = cos.len() / LANES * LANES;
        for at in (0..whole).step_by(LANES) {
            let lanes = |values: &[f32]| -> [f32; LANES] { values[at..at + LANES].try_into().expect("as many") };
            let (x, y, z, cos, sin) = (lanes(x), lanes(y), lanes(z), lanes(cos), lanes(sin));
            for lane in 0..LANES {
                let sum = sum(x[lane], y[lane], z[lane], cos[lane], sin[lane]);
                least[lane] = if sum < least[lane] { sum } else { least[lane] };
            }
        }
        for at in whole..cos.len() {
            least[0] = least[0].min(sum(x[at], y[at], z[at], cos[at], sin[at]));
        }
        // More than the roundings above.
        least.into_iter().fold(1.0_f32, f32::min) - 1e-6
    }
}

/// The sine of an angle whose cosine is known to 1e-7: rounded up, by no more than 7e-4 where the angle is near 0.
fn sine(cos: f32) -> f32 {
    (1.0 - cos * cos + 4e-7).max(0.0).sqrt()
}

fn normal_at(axis: &[Vec<f32>; 3], at: usize) -> Vec3 {
    Vec3::from_array(axis.each_ref().map(|values| values[at]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn units() -> impl Strategy<Value = Vec<(Sphere, u16, f32)>> {
        let unit = (prop::array::uniform3(-1e3f32..1e3), 0f32..10.0, 0u16..16_224, 0f32..1.6).prop_map(
            |(center, radius, normal, angle)| {
                (Sphere { center: Vec3::from_array(center), radius }, normal, libm::cosf(angle))
            },
        );
        prop::collection::vec(unit, 1..40)
    }

    proptest! {
        #[test]
        fn a_node_holds_all_its_units(units in units(), share in 0f32..1.0) {
            let mut arrays = Units::default();
            let mut sums = Sums::NOTHING;
            for (sphere, code, cos) in &units {
                // Normals near one of them, else every cone would be full.
                let near = normal::decode(units[0].1).lerp(normal::decode(*code), share * 0.5).normalize_or(Vec3::Y);
                let axis = normal::decode(normal::encode(near));
                arrays.push(sphere, axis, *cos);
                sums = sums.and(&Sums::of_leaf(sphere, axis, Vec3::ZERO));
            }
            let node = arrays.node(0..units.len(), sums);
            for (at, (sphere, ..)) in units.iter().enumerate() {
                prop_assert!(node.sphere.encloses(sphere), "{:?} {:?}", node.sphere, sphere);
                let axis = normal_at(&arrays.axis, at).as_dvec3().normalize();
                let between = libm::acos(normal::decode(node.normal).as_dvec3().normalize().dot(axis).clamp(-1.0, 1.0));
                let half = if arrays.cos[at] < 0.0 { 4.0 } else { libm::acos(f64::from(arrays.cos[at])) };
                let spread = if node.cos_spread <= -1.0 { 10.0 } else { libm::acos(f64::from(node.cos_spread)) };
                prop_assert!(between + half <= spread + 1e-9 || node.cos_spread <= -1.0, "{between} {half} {spread}");
            }
        }
    }
}
