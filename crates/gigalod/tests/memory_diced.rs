//! What the builder allocates for a model whose triangles are diced, counted to the byte: `memory_bytes` bounds all of it, pictures
//! included.

mod budget;
mod counting;
mod painted;

use budget::fullest;
use gigalod::build::{NoProgress, Options, splats};
use glam::DVec3;
use painted::{Lent, Painted};

#[test]
fn a_build_that_dices_allocates_no_more_than_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.glod");
    let mut model = Painted::default();
    // Together, pictures are larger than the smallest budgets.
    for number in 0..24u32 {
        model.picture(1024, |x, y| [(x * y) as u8, (x + number) as u8, y as u8, 255]);
    }
    for at in 0..30_000u32 {
        let corner = DVec3::new(f64::from(at % 200), f64::from(at / 200), f64::from(at % 7));
        model.wall(corner, [DVec3::X * 0.9, DVec3::new(0.0, 0.8, 0.3)], at % 24);
    }
    model.wall(DVec3::new(0.0, 0.0, -5.0), [DVec3::X * 200.0, DVec3::Y * 150.0], 3);
    let mut most = 0.0_f64;
    for (is_declared, is_painted) in [(false, true), (true, true), (true, false)] {
        let mut model = Painted { is_declared, ..model.clone() };
        if !is_painted {
            (model.corners, model.materials, model.tex_coords, model.pictures) = (vec![], vec![], vec![], vec![]);
        }
        let lend = || Box::new(Lent(Box::leak(Box::new(model.clone()))));
        let build = |stream: Box<Lent>, memory_bytes, threads| {
            let options = Options { memory_bytes, threads, spacing: Some(0.22), ..Options::default() };
            splats::build(stream, &options, &NoProgress, &out).unwrap();
        };
        let what = format!("declared {is_declared}, painted {is_painted}");
        most = most.max(fullest(&what, &[(64, 2), (64, 16), (160, 2), (1024, 16)], lend, build));
    }
    assert!(most > 0.4, "the counter counts");
}
