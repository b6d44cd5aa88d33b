//! Quantisers of the splats paper, section 3.1: what fits a node into 32 bits.

pub mod around;
pub mod cone;
pub mod normal;
pub mod sphere;
