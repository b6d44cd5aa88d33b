//! Damaged files give a model or an error, soon and in bounded memory; [`read`] holds each batch to its bounds.

use crate::{
    document::{Document, FLAVOURS, Flavour, Random},
    sources::read,
};

#[test]
fn two_hundred_truncations_of_each_flavour_are_errors() {
    for flavour in FLAVOURS {
        for seed in 0..4 {
            let document = Document::random(&mut Random(seed), 12);
            let bytes = document.bytes(flavour, "\n");
            for cut in (0..50).map(|number| number * bytes.len() / 50) {
                // Text may lose the end of its last number, and nobody can tell; binary data is incomplete at once.
                match read(&bytes[..cut]) {
                    Ok(model) => assert!(flavour == Flavour::Ascii && model.positions.len() == 12, "{seed} {cut}"),
                    Err(error) => assert!(!error.to_string().contains('\n')),
                }
            }
        }
    }
}

#[test]
fn two_thousand_flips_of_each_flavour_neither_panic_nor_run_away() {
    for flavour in FLAVOURS {
        let mut random = Random(2);
        let mut whole = 0;
        for seed in 0..20 {
            let bytes = Document::random(&mut Random(seed), 10).bytes(flavour, "\n");
            for _ in 0..100 {
                let mut damaged = bytes.clone();
                for _ in 0..=random.below(4) {
                    damaged[random.below(bytes.len())] = random.next() as u8;
                }
                if let Ok(model) = read(&damaged) {
                    // A corner takes a byte at least, a vertex three.
                    assert!(model.positions.len() * 3 + model.triangles.len() <= bytes.len());
                    whole += 1;
                }
            }
        }
        assert!((1..2000).contains(&whole), "{flavour:?}: {whole} of 2000 were read");
    }
}
