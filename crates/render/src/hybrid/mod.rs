//! Hybrid: nodes of triangles, points and lines into the G-buffer.
//!
//! Pages of nodes stay on the device ([`arena`]); a frame sends a table of what it draws ([`plan`]). A compute pass draws what is
//! small, another what is large, both into keys as splats have them, and a last one looks up what won in each pixel
//! ([`keyed`]). Where vertices are on the screen stands in one place for all, `shader/hybrid_place.wgsl`; what a triangle covers in
//! `shader/hybrid_triangle.wgsl`.
//!
//! What always holds: each pixel of a surface without gaps belongs to exactly one of its triangles, whichever way they take; which
//! way that is is never to be seen.

pub(crate) mod arena;
pub(crate) mod keyed;
pub(crate) mod params;
pub(crate) mod pipelines;
pub(crate) mod plan;

#[cfg(test)]
use crate::shader::Target;

/// What is small.
pub(crate) const SMALL: &str = include_str!("../shader/hybrid_small.wgsl");
/// What is large.
const LARGE: &str = include_str!("../shader/hybrid_large.wgsl");
/// Keys to G-buffer.
const RESOLVE: &str = include_str!("../shader/hybrid_resolve.wgsl");

/// All passes, by name, with where they deliver.
#[cfg(test)]
pub(crate) fn sources() -> impl Iterator<Item = (&'static str, &'static str, Target)> {
    [("small", SMALL), ("large", LARGE)]
        .into_iter()
        .flat_map(|(name, source)| [Target::Keys64, Target::Keys32].map(|target| (name, source, target)))
        .chain([("resolve", RESOLVE, Target::None)])
}
