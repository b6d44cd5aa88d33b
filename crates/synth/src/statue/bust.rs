//! The whole bust as one signed distance, and which material is nearest.
//!
//! Takes a point in metres (y up, base at 0, chest towards +z, head not yet turned); gives the distance and the shares
//! of skin, hair, beard, cloth and base. Start at [`bust`].

use super::head::head;
use super::ray::Ray;
use super::shape::{HEAD_CENTER, HEAD_M, Shape};
use crate::math::{ellipsoid, rod, smax, smin, smoothstep};
use crate::noise::noise3;
use glam::{Vec2, Vec3};

/// Height of the drum under the chest, metres.
const BASE_M: f32 = 0.26;
/// No surface is farther than this from its ray's origin, metres.
pub(super) const FAR_M: f32 = 1.5;

/// What a point is near to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bust {
    /// Signed distance to the surface, metres.
    pub(super) distance: f32,
    /// 1 well inside the hair on the skull, 0 well outside.
    pub(super) hair: f32,
    /// The same for beard and moustache.
    pub(super) beard: f32,
    /// The same for the draped chest.
    pub(super) cloth: f32,
    /// The same for the drum.
    pub(super) base: f32,
}

/// How far the symmetric statue is moved along `ray`: nothing alive is symmetric. Slow; up to 2 cm.
fn asymmetry(ray: &Ray, shape: &Shape) -> Vec3 {
    noise3(shape.seed ^ 0x51, ray.at(0.6) * 1.7) * (0.016 * smoothstep(-0.75, -0.4, ray.direction.y))
}

/// The symmetric bust around `p`.
fn bust(p: Vec3, shape: &Shape) -> Bust {
    // Parts too far away to matter, even by their rounded joints, are replaced by a bound.
    let base = if p.y < 0.6 { drum(p) } else { p.y - 0.3 };
    let torso = if p.y < 1.65 { torso(p, shape) } else { p.y - 1.45 };
    let mut skin = (1.2 - p.y).max(p.x.abs() - 0.5);
    let (mut hair, mut beard) = (skin, skin);
    if skin < 0.2 {
        let parts = head((p - HEAD_CENTER) / HEAD_M, shape);
        (skin, hair, beard) = (parts.skin * HEAD_M, parts.hair * HEAD_M, parts.beard * HEAD_M);
        if p.y < 1.8 {
            skin = smin(skin, neck(p), 0.10);
        }
    }
    let flesh = smin(skin, torso, 0.12);
    let furry = smin(hair, beard, 0.05);
    let body = smin(flesh, furry, 0.035);
    let share = |of: f32, others: f32| smoothstep(-0.012, 0.03, others - of);
    Bust {
        distance: smin(body, base, 0.05),
        hair: share(hair, flesh.min(beard)),
        beard: share(beard, flesh.min(hair)),
        cloth: share(torso, skin.min(furry).min(base)),
        base: share(base, torso),
    }
}

fn neck(p: Vec3) -> f32 {
    let q = Vec3::new(p.x.abs(), p.y, p.z);
    let column = rod(q, Vec3::new(0.0, 1.05, -0.10), Vec3::new(0.0, 1.8, -0.06), 0.285, 0.27);
    let muscle = rod(q, Vec3::new(0.05, 1.13, 0.20), Vec3::new(0.27, 1.75, -0.10), 0.045, 0.075);
    smin(column, muscle, 0.06)
}

fn torso(p: Vec3, shape: &Shape) -> f32 {
    let q = Vec3::new((p.x * p.x + 0.004).sqrt() / shape.shoulders, p.y, p.z);
    let v = Vec3::new;
    let ribs = ellipsoid(q - v(0.0, 0.66, -0.02), v(0.70, 0.62, 0.48));
    let chest = ellipsoid(q - v(0.27, 0.86, 0.18), v(0.34, 0.27, 0.24));
    let shoulder = ellipsoid(q - v(0.72, 0.86, -0.06), v(0.25, 0.33, 0.27));
    let slope = rod(q, v(0.17, 1.24, -0.13), v(0.66, 1.02, -0.08), 0.15, 0.15);
    let back = ellipsoid(q - v(0.28, 0.92, -0.26), v(0.34, 0.32, 0.20));
    let d = smin(smin(smin(ribs, chest, 0.14), shoulder, 0.16), smin(slope, back, 0.15), 0.14);
    smax(d, arm_cut(p, shape), 0.06)
}

/// Distance to the plane where the arms end in a flat cut, as the sculptor left them; negative towards the chest.
pub(super) fn arm_cut(p: Vec3, shape: &Shape) -> f32 {
    p.x.abs() / shape.shoulders * 0.97 + (p.y - 0.8) * 0.22 - 0.84
}

fn drum(p: Vec3) -> f32 {
    let radial = Vec2::new(p.x, p.z).length();
    let rounded = |radius: f32, low: f32, high: f32, round: f32| {
        let d = Vec2::new(radial - radius + round, (p.y - (low + high) * 0.5).abs() - (high - low) * 0.5 + round);
        d.max(Vec2::ZERO).length() + d.max_element().min(0.0) - round
    };
    let shaft = rounded(0.46, -0.1, BASE_M, 0.02);
    // Two turned grooves. A foot that stands out would hide what lies above it from the rays.
    let groove = |y: f32| Vec2::new(radial - 0.468, p.y - y).length() - 0.018;
    let d = smax(smax(shaft, -groove(0.065), 0.01), -groove(0.205), 0.01);
    // The underside is the plane y = 0.
    d.max(-p.y)
}

/// Where a ray leaves the statue.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Parameter along the ray, metres.
    pub(super) radius: f32,
    /// The statue there.
    pub(super) bust: Bust,
}

/// Where `ray` meets the surface for the last time, searched inwards from `outside` (metres along the ray; from
/// [`FAR_M`] where that is inside).
pub(super) fn hit(ray: &Ray, shape: &Shape, outside: f32) -> Hit {
    let moved = asymmetry(ray, shape);
    let at = |t: f32| bust(ray.at(t) + moved, shape);
    let mut outside = outside.min(FAR_M);
    let mut d_outside = at(outside).distance;
    if d_outside < 0.0 {
        outside = FAR_M;
        d_outside = at(outside).distance;
    }
    // March inwards; distances are not exact, so with steps a little shorter than they promise.
    let (mut inside, mut d_inside) = (0.0, -1.0);
    for _ in 0..120 {
        let t = (outside - (d_outside * 0.85).max(0.003)).max(0.0);
        let d = at(t).distance;
        if d < 0.0 || t == 0.0 {
            (inside, d_inside) = (t, d.min(-1e-9));
            break;
        }
        (outside, d_outside) = (t, d);
    }
    // Two secant steps inside a bracket of millimetres leave micrometres.
    let secant = |inside: f32, d_inside: f32, outside: f32, d_outside: f32| {
        inside + (outside - inside) * (d_inside / (d_inside - d_outside)).clamp(0.0, 1.0)
    };
    let middle = secant(inside, d_inside, outside, d_outside);
    let bust = at(middle);
    let radius = if bust.distance < 0.0 {
        secant(middle, bust.distance, outside, d_outside)
    } else {
        secant(inside, d_inside, middle, bust.distance.max(1e-9))
    };
    Hit { radius, bust }
}
