//! The head: skull, face and ears, and the masses of hair and beard, as distances.
//!
//! Takes a point in head space (1 = chin to crown; origin at eye height between the ears; y up, face towards +z) and
//! the proportions; gives two signed distances (skin, and hair with beard) in head-space units. Both are symmetric in
//! x: life comes from the pose, the warp and the relief added elsewhere.

use super::shape::Shape;
use crate::math::{ellipsoid, rod, smax, smin, smoothstep};
use glam::Vec3;

/// Signed distances of one point, head-space units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    /// Skull, face, ears.
    pub(super) skin: f32,
    /// Hair on the skull.
    pub(super) hair: f32,
    /// Beard and moustache.
    pub(super) beard: f32,
}

/// Middle of the left ear (and of the right, mirrored).
const EAR: Vec3 = v(0.32, -0.055, -0.045);

const fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Distances from `p`.
pub(super) fn head(p: Vec3, shape: &Shape) -> Head {
    // Rounded over the middle, so that pairs of forms leave no crease there.
    let q = v((p.x * p.x + 0.0004).sqrt() - 0.006, p.y, p.z);
    Head { skin: skin(q, shape), hair: hair(q, shape), beard: beard(q, shape) }
}

fn skin(q: Vec3, shape: &Shape) -> f32 {
    let cranium = ellipsoid(q - v(0.0, 0.13, -0.05), v(0.325, 0.37, 0.425));
    let mask = ellipsoid(q - v(0.0, -0.12, 0.10), v(0.262 * shape.jaw, 0.385, 0.305));
    let mut d = smin(cranium, mask, 0.10);
    // Jaw and chin.
    d = smin(d, rod(q, v(0.0, -0.43, 0.30), v(0.215 * shape.jaw, -0.27, 0.0), 0.085, 0.07), 0.08);
    d = smin(d, (q - v(0.03, -0.445, 0.325)).length() - 0.072, 0.06);
    // Cheekbone, and the cheek below it.
    d = smin(d, ellipsoid(q - v(0.185 * shape.jaw, -0.10, 0.235), v(0.085, 0.055, 0.09)), 0.07);
    d = smin(d, rod(q, v(0.19, -0.10, 0.23), v(0.285, -0.06, 0.0), 0.03, 0.03), 0.06);
    if q.z > 0.1 {
        d = face(q, d, shape);
    }
    smin(d, ear(q), 0.025)
}

/// What only the front of the head has.
fn face(q: Vec3, mut d: f32, shape: &Shape) -> f32 {
    let eye = v(shape.eye_x, -0.005, 0.272);
    // Forehead: two faint bosses; brow ridge above the sockets.
    d = smin(d, ellipsoid(q - v(0.09, 0.20, 0.30), v(0.11, 0.10, 0.08)), 0.08);
    let brow = 0.028 * shape.brow;
    d = smin(d, rod(q, v(0.035, 0.068, 0.372), v(0.15, 0.098, 0.335), brow, brow), 0.05);
    d = smin(d, rod(q, v(0.15, 0.098, 0.335), v(0.225, 0.055, 0.255), brow, brow * 0.7), 0.05);
    // Sockets: deep at the inner corner, under the brow.
    d = smax(d, -ellipsoid(q - v(shape.eye_x - 0.004, 0.006, 0.395), v(0.088, 0.056, 0.085)), 0.05);
    d = smax(d, -ellipsoid(q - v(0.062, 0.012, 0.385), v(0.03, 0.04, 0.045)), 0.04);
    // Nose: a bridge with a hump, tip, wings, nostrils.
    let tip = v(0.0, -0.185 * shape.nose, 0.478 + 0.02 * (shape.nose - 1.0));
    let root = v(0.0, 0.045, 0.378);
    let along = ((q - root).dot(tip - root) / (tip - root).length_squared()).clamp(0.0, 1.0);
    let hump = shape.nose_hump * 4.0 * along * (1.0 - along);
    d = smin(d, rod(q, root, tip, 0.034, 0.040 * shape.nose_width) - hump, 0.035);
    d = smin(d, ellipsoid(q - tip - v(0.0, -0.004, 0.004), v(0.040 * shape.nose_width, 0.036, 0.042)), 0.02);
    let wing = v(0.056 * shape.nose_width, tip.y - 0.018, 0.408);
    d = smin(d, ellipsoid(q - wing, v(0.030, 0.030, 0.044)), 0.022);
    d = smax(d, -ellipsoid(q - v(0.030 * shape.nose_width, tip.y - 0.046, 0.448), v(0.015, 0.02, 0.024)), 0.012);
    // Nasolabial fold: a soft furrow from the wing to beyond the mouth's corner.
    d = smax(d, -(rod(q, wing + v(0.03, -0.005, 0.01), v(0.128, -0.30, 0.385), 0.010, 0.014)), 0.04);
    d = mouth(q, d, shape);
    // Eyeball with lids; drawn last, so that nothing blurs the lids.
    smin(d, eyeball(q - eye), 0.018)
}

fn mouth(q: Vec3, mut d: f32, shape: &Shape) -> f32 {
    let full = shape.lips;
    d = smin(d, ellipsoid(q - v(0.0, -0.31, 0.315), v(0.125, 0.095, 0.098)), 0.06);
    // Philtrum.
    d = smax(d, -rod(q, v(0.0, -0.25, 0.437), v(0.0, -0.292, 0.434), 0.009, 0.011), 0.02);
    // Upper lip: a bow with a dip in the middle; lower lip: one full cushion.
    d = smin(d, rod(q, v(0.022, -0.309, 0.412), v(0.100, -0.331, 0.362), 0.017 * full, 0.008), 0.016);
    d = smin(d, rod(q, v(0.0, -0.3575, 0.402), v(0.082, -0.343, 0.368), 0.023 * full, 0.010), 0.018);
    // The line between the lips, and the hollow below them.
    let parting = rod(q, v(0.0, -0.3315, 0.434), v(0.108, -0.336, 0.372), 0.007, 0.006);
    d = smax(d, -parting, 0.012);
    smax(d, -ellipsoid(q - v(0.0, -0.398, 0.432), v(0.07, 0.018, 0.03)), 0.03)
}

/// Eyeball, lids, and the drilled iris and pupil of Roman portraits. `e` is relative to the eye's centre; the outer
/// corner lies at +x.
fn eyeball(e: Vec3) -> f32 {
    let distance = e.length();
    let (x, y) = (e.x / distance, e.y / distance);
    if e.z < 0.0 {
        return distance - 0.066;
    }
    // The opening between the lids, in sines of the visual angle. The inner corner dips, the outer is drawn out.
    let across = (x - 0.02) / 0.86;
    let arch = (1.0 - across * across).max(0.0);
    let upper = 0.40 * arch * (1.0 - 0.12 * across) - 0.05 - 0.06 * across * across;
    let lower = -0.27 * arch - 0.05 - 0.05 * across * across;
    let above = smoothstep(-0.01, 0.05, y - upper);
    let below = smoothstep(-0.01, 0.05, lower - y);
    // Rims of the lids stand out a little more than the lids themselves.
    let rim = 0.0035 * bump((y - upper - 0.07) / 0.07) + 0.0025 * bump((lower - y - 0.06) / 0.06);
    let lid = 0.0105 * above + 0.008 * below;
    let gaze = ((x + 0.02) * (x + 0.02) + (y - 0.06) * (y - 0.06)).sqrt();
    let open = (1.0 - above) * (1.0 - below);
    let ring = 0.0028 * bump((gaze - 0.375) / 0.055);
    let pupil = 0.014 * smoothstep(0.20, 0.10, gaze + 0.35 * (y - 0.06));
    distance - 0.066 - lid - rim + open * (ring + pupil)
}

/// 1 at 0, 0 beyond ±1, smooth.
fn bump(x: f32) -> f32 {
    let t = (1.0 - x * x).max(0.0);
    t * t
}

fn ear(q: Vec3) -> f32 {
    // Leaning back.
    let e = q - EAR;
    let e = v(e.x, e.y * 0.96 - e.z * 0.28, e.z * 0.96 + e.y * 0.28);
    if e.length() > 0.25 {
        return e.length() - 0.15;
    }
    let body = ellipsoid(e, v(0.05, 0.135, 0.082));
    // The rim is what remains when the shell is carved; the lobe stays.
    let shell = ellipsoid(e - v(0.055, 0.022, 0.006), v(0.045, 0.088, 0.048));
    let concha = ellipsoid(e - v(0.045, -0.012, 0.022), v(0.05, 0.042, 0.032));
    let fold = rod(e, v(0.03, 0.07, -0.01), v(0.03, -0.02, -0.025), 0.016, 0.014);
    smax(smin(smax(body, -shell, 0.02), fold, 0.012), -concha, 0.014)
}

fn hair(q: Vec3, shape: &Shape) -> f32 {
    let lift = 0.05 * (shape.hair - 1.0);
    let cap = ellipsoid(q - v(0.0, 0.14, -0.07), v(0.395 + lift, 0.435 + lift, 0.485 + lift));
    let nape = ellipsoid(q - v(0.0, -0.22, -0.27), v(0.29, 0.26, 0.20));
    let sides = ellipsoid(q - v(0.315, 0.07, -0.05), v(0.10, 0.22, 0.22));
    let mass = smin(smin(cap, nape, 0.12), sides, 0.08);
    // The hairline: a plane from the forehead over the ears to the nape, higher at the temples.
    let temples = 0.055 * bump((q.x - 0.15) / 0.12) - 0.035 * bump(q.x / 0.1);
    let line = (0.97 * q.z - 0.082 + temples - q.y) * 0.72;
    // The ear is left free.
    let around_ear = ellipsoid(q - EAR - v(0.03, 0.0, 0.02), v(0.13, 0.12, 0.085));
    smax(smax(mass, line, 0.09), -around_ear, 0.09)
}

fn beard(q: Vec3, shape: &Shape) -> f32 {
    let long = shape.beard;
    let chin = ellipsoid(q - v(0.0, -0.50 - 0.04 * (long - 1.0), 0.235), v(0.185, 0.215 * long, 0.17));
    let cheeks = rod(q, v(0.12, -0.44, 0.26), v(0.262 * shape.jaw, -0.22, 0.06), 0.11, 0.075);
    let sideburn = rod(q, v(0.262 * shape.jaw, -0.22, 0.05), v(0.275, 0.04, 0.095), 0.065, 0.045);
    let mass = smin(smin(chin, cheeks, 0.12), sideburn, 0.06);
    // Above this line there is no beard: from the ear to the mouth's corner. Nor around the lips.
    let line = (q.y + 0.02 + 0.80 * (q.z - 0.03)) * 0.78;
    let lips = 0.036 - ellipsoid(q - v(0.0, -0.335, 0.42), v(0.088, 0.026, 0.09));
    let mass = smax(smax(mass, line, 0.07), lips, 0.03);
    let moustache = rod(q, v(0.018, -0.272, 0.425), v(0.098, -0.300, 0.388), 0.020, 0.026);
    let tail = rod(q, v(0.098, -0.300, 0.388), v(0.150, -0.40, 0.31), 0.026, 0.028);
    smin(mass, smin(moustache, tail, 0.02), 0.03)
}
