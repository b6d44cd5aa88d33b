//! Properties of built hierarchies over random and nasty meshes; the judge walks the *file* from its root and knows nothing
//! of how it was made.
