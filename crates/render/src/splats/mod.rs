//! Splats: balls into the G-buffer.
//!
//! Where the device can write storage, small splats go through a compute pass and large ones through the pipeline, both into
//! the same keys ([`keyed`]); elsewhere all go through the pipeline with a depth test ([`depth_test`]). What a splat is on the
//! screen stands in one place for all of them, `shader/splat_shape.wgsl`.

pub(crate) mod depth_test;
pub(crate) mod keyed;
pub(crate) mod params;
pub(crate) mod pipelines;
pub(crate) mod store;

#[cfg(test)]
use crate::shader::Target;

/// Small splats.
pub(crate) const COMPUTE: &str = include_str!("../shader/splat_compute.wgsl");
/// Large splats.
const QUADS: &str = include_str!("../shader/splat_quads.wgsl");
/// Keys to G-buffer.
const RESOLVE: &str = include_str!("../shader/splat_resolve.wgsl");
/// Sums to G-buffer.
const BLEND: &str = include_str!("../shader/splat_blend.wgsl");
/// All splats, without storage.
const DEPTH_TEST: &str = include_str!("../shader/splat_depth_test.wgsl");

/// All passes, by name, with where they deliver.
#[cfg(test)]
pub(crate) fn sources() -> impl Iterator<Item = (&'static str, &'static str, Target)> {
    let delivering = [("compute", COMPUTE), ("quads", QUADS)]
        .into_iter()
        .flat_map(|(name, source)| [Target::Keys64, Target::Keys32, Target::Sums].map(|target| (name, source, target)));
    delivering
        .chain([("compute", COMPUTE, Target::Keys64Found)])
        .chain([("resolve", RESOLVE), ("blend", BLEND), ("depth test", DEPTH_TEST)].map(|(n, s)| (n, s, Target::None)))
}

/// The shape of a splat; the splats paper, section 3.3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Kernel {
    /// The square around the ball's silhouette.
    Square,
    /// The ball's silhouette itself.
    #[default]
    Round,
    /// A spot whose opacity falls smoothly from 1 in the middle over 1/2 on the silhouette to 0 at twice that; spots that lie
    /// close behind each other blend.
    Gauss,
    /// [`Kernel::Square`], foreshortened as a disc with the splat's normal is.
    SquareEllipse,
    /// [`Kernel::Round`], foreshortened.
    RoundEllipse,
    /// [`Kernel::Gauss`], foreshortened.
    GaussEllipse,
}

impl Kernel {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Square, Self::Round, Self::Gauss, Self::SquareEllipse, Self::RoundEllipse, Self::GaussEllipse];

    /// True where splats blend.
    pub fn is_gauss(self) -> bool {
        matches!(self, Self::Gauss | Self::GaussEllipse)
    }

    /// True where splats are foreshortened. Then there may be holes: normals need not be continuous along a surface.
    pub fn is_elliptical(self) -> bool {
        matches!(self, Self::SquareEllipse | Self::RoundEllipse | Self::GaussEllipse)
    }

    /// As in the shaders.
    fn code(self) -> f64 {
        Self::ALL.iter().position(|kernel| *kernel == self).expect("all are listed") as f64
    }
}
