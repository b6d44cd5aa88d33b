//! Cones of normals, and which side of a surface the eye sees.
//!
//! Source: Shirman & Abi-Ezzi, *The cone of normals technique for fast processing of curved patches*, Eurographics 1993,
//! as used for culling in the splats paper, section 2.1.

use glam::Vec3;

/// All directions within a half-angle of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalCone {
    /// Unit vector.
    pub axis: Vec3,
    /// Sine of the half-angle. A value ≥ 1 stands for every direction there is: such a cone faces nowhere.
    pub sin_half_angle: f32,
}

/// How a ball of surface with a cone of normals faces the eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Facing {
    /// Every point shows its back.
    Away,
    /// Every point shows its front.
    Toward,
    /// Neither is certain.
    Unsure,
}

impl NormalCone {
    /// How the surface inside the ball (`center_in_eye`, `radius`) faces the eye, decided without a square root.
    ///
    /// Sound but not tight: it uses sin(α + β) ≤ sin α + sin β for the cone's half-angle α and the angle β under which the
    /// eye sees the ball's radius. [`NormalCone::faces_away`] is tight. Both leave a margin of 1e-5 of the distance, so that
    /// this one never says `Away` where that one, on a smaller ball and cone, says no.
    pub fn facing(&self, center_in_eye: Vec3, radius: f32) -> Facing {
        if self.sin_half_angle >= 1.0 {
            return Facing::Unsure;
        }
        let along = self.axis.dot(center_in_eye);
        let clear = along.abs() - radius;
        let spread = self.sin_half_angle + 2e-5;
        if clear <= 0.0 || clear * clear <= center_in_eye.length_squared() * spread * spread {
            return Facing::Unsure;
        }
        if along > 0.0 { Facing::Away } else { Facing::Toward }
    }

    /// True when every point of the ball, with every normal of the cone, shows its back to the eye (angle between normal and
    /// viewing ray below 90° − α − β). If it is true of a ball and a cone, it is true of all balls and cones inside them.
    pub fn faces_away(&self, center_in_eye: Vec3, radius: f32) -> bool {
        if self.sin_half_angle >= 1.0 {
            return false;
        }
        let distance_squared = center_in_eye.length_squared();
        if distance_squared <= radius * radius {
            return false;
        }
        let sin_alpha = self.sin_half_angle;
        let cos_alpha = (1.0 - sin_alpha * sin_alpha).sqrt();
        let distance = distance_squared.sqrt();
        let sin_beta = radius / distance;
        let cos_beta = (1.0 - sin_beta * sin_beta).max(0.0).sqrt();
        // α + β ≥ 90° leaves no direction.
        if cos_alpha * cos_beta <= sin_alpha * sin_beta {
            return false;
        }
        let sin_sum = sin_alpha * cos_beta + cos_alpha * sin_beta;
        self.axis.dot(center_in_eye) > distance * (sin_sum + 1e-5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-1f32..1.0).prop_filter_map("zero", |v| Vec3::from_array(v).try_normalize())
    }

    /// A unit vector within the cone.
    fn tilted(cone: &NormalCone, towards: Vec3, share: f32) -> Vec3 {
        let side = (towards - cone.axis * towards.dot(cone.axis)).normalize_or_zero();
        let angle = libm::asinf(cone.sin_half_angle) * share;
        cone.axis * libm::cosf(angle) + side * libm::sinf(angle)
    }

    proptest! {
        #[test]
        fn what_is_said_of_a_cone_holds_for_each_normal_and_point(
            axis in unit(), towards in unit(), offset in unit(), center in prop::array::uniform3(-3f32..3.0),
            sin in 0f32..0.99, radius in 0f32..1.0, share in 0f32..1.0, depth in 0f32..1.0,
        ) {
            let center = Vec3::from_array(center);
            let cone = NormalCone { axis, sin_half_angle: sin };
            let normal = tilted(&cone, towards, share);
            let point = center + offset * radius * depth;
            match cone.facing(center, radius) {
                Facing::Away => {
                    prop_assert!(normal.dot(point) > 0.0);
                    prop_assert!(cone.faces_away(center, radius), "the quick test is the stricter one");
                    let inner = NormalCone { axis: normal, sin_half_angle: 0.0 };
                    prop_assert!(inner.faces_away(point, 0.0), "what lies inside faces away too");
                }
                Facing::Toward => prop_assert!(normal.dot(point) < 0.0),
                Facing::Unsure => {}
            }
            if cone.faces_away(center, radius) {
                prop_assert!(normal.dot(point) > 0.0);
            }
        }
    }

    #[test]
    fn a_full_cone_faces_nowhere() {
        let cone = NormalCone { axis: Vec3::Z, sin_half_angle: 1.0 };
        assert_eq!(cone.facing(Vec3::Z * 9.0, 0.0), Facing::Unsure);
        assert!(!cone.faces_away(Vec3::Z * 9.0, 0.0));
    }
}
