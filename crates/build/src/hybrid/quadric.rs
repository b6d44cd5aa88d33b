//! Quadrics: the weighted sum of squared distances to planes, and where it is least. They put operations in order; they bound
//! nothing.
//!
//! Source: Garland & Heckbert, *Surface Simplification Using Quadric Error Metrics*, SIGGRAPH 1997, sections 4 and 6. Planes are
//! weighted by area; borders have planes of their own, upright on the face.

use glam::DVec3;

/// ∑ w (n·x + d)², as its ten coefficients; x is relative to an anchor that all quadrics of a surface share.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    xx: f64,
    xy: f64,
    xz: f64,
    yy: f64,
    yz: f64,
    zz: f64,
    /// −½ of the gradient at the anchor.
    b: DVec3,
    c: f64,
    /// Area of the faces in it.
    pub(super) area: f64,
}

impl Quadric {
    /// Of the plane through `point` with a unit normal.
    pub(super) fn plane(normal: DVec3, point: DVec3, weight: f64) -> Self {
        let d = -normal.dot(point);
        let n = normal * weight;
        Self {
            xx: n.x * normal.x,
            xy: n.x * normal.y,
            xz: n.x * normal.z,
            yy: n.y * normal.y,
            yz: n.y * normal.z,
            zz: n.z * normal.z,
            b: -n * d,
            c: weight * d * d,
            area: 0.0,
        }
    }

    /// Of a point, in all directions: a little of it makes any quadric have one least place.
    pub(super) fn point(point: DVec3, weight: f64) -> Self {
        let w = weight;
        Self { xx: w, yy: w, zz: w, b: point * w, c: w * point.length_squared(), ..Self::default() }
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            xx: self.xx + other.xx,
            xy: self.xy + other.xy,
            xz: self.xz + other.xz,
            yy: self.yy + other.yy,
            yz: self.yz + other.yz,
            zz: self.zz + other.zz,
            b: self.b + other.b,
            c: self.c + other.c,
            area: self.area + other.area,
        }
    }

    /// Its value.
    pub(super) fn at(&self, p: DVec3) -> f64 {
        let row = DVec3::new(
            self.xx * p.x + self.xy * p.y + self.xz * p.z,
            self.xy * p.x + self.yy * p.y + self.yz * p.z,
            self.xz * p.x + self.yz * p.y + self.zz * p.z,
        );
        (p.dot(row) - 2.0 * self.b.dot(p) + self.c).max(0.0)
    }

    /// Where it is least; none where that is not one place.
    pub(super) fn least(&self) -> Option<DVec3> {
        let (xx, xy, xz, yy, yz, zz) = (self.xx, self.xy, self.xz, self.yy, self.yz, self.zz);
        let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let determinant = xx * cx + xy * cy + xz * cz;
        let size = (xx + yy + zz) / 3.0;
        if determinant.abs() <= 1e-9 * size * size * size {
            return None;
        }
        let b = self.b;
        let x = cx * b.x + cy * b.y + cz * b.z;
        let y = cy * b.x + (xx * zz - xz * xz) * b.y + (xy * xz - xx * yz) * b.z;
        let z = cz * b.x + (xy * xz - xx * yz) * b.y + (xx * yy - xy * xy) * b.z;
        Some(DVec3::new(x, y, z) / determinant)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_where_their_quadric_is_least() {
        let at = DVec3::new(1.0, -2.0, 3.0);
        let normals = [DVec3::X, DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.0, 0.6, 0.8)];
        let sum = normals.iter().fold(Quadric::default(), |sum, n| sum.plus(&Quadric::plane(*n, at, 2.0)));
        assert!((sum.least().unwrap() - at).length() < 1e-9);
        assert!(sum.at(at) < 1e-12);
        let off = at + DVec3::new(0.1, 0.0, 0.0);
        assert!((sum.at(off) - 2.0 * (0.01 + 0.0036)).abs() < 1e-9, "{}", sum.at(off));
        assert!(Quadric::plane(DVec3::X, at, 1.0).least().is_none(), "a plane has no least place");
    }
}
