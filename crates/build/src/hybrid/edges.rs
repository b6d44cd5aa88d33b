//! Edges of faces.
//!
//! In: faces. Out: their sides, in order of the edges that they are at, so that those of one edge are beside each other. The time is as
//! the number of faces: sides are counted into the place of their lower end, and few are there.

/// A side of a face.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Side {
    /// Of its edge, the lower number first.
    pub(super) ends: [u32; 2],
    pub(super) face: u32,
    /// The corner where it begins, of three.
    pub(super) first: u32,
}

/// All sides of faces, which are numbers and corners, among so many vertices.
pub(super) fn sides(vertices: usize, faces: impl Iterator<Item = (u32, [u32; 3])> + Clone) -> Vec<Side> {
    let of = |(face, corners): (u32, [u32; 3])| {
        [0, 1, 2].map(|first: usize| {
            let (a, b) = (corners[first], corners[(first + 1) % 3]);
            Side { ends: [a.min(b), a.max(b)], face, first: first as u32 }
        })
    };
    let mut begins = vec![0u32; vertices + 1];
    faces.clone().flat_map(of).for_each(|side| begins[side.ends[0] as usize + 1] += 1);
    for vertex in 0..vertices {
        begins[vertex + 1] += begins[vertex];
    }
    let mut all = vec![Side::default(); begins[vertices] as usize];
    for side in faces.flat_map(of) {
        let place = &mut begins[side.ends[0] as usize];
        all[*place as usize] = side;
        *place += 1;
    }
    // Each beginning is now the next one's.
    let mut begin = 0;
    for end in &begins[..vertices] {
        all[begin..*end as usize].sort_unstable();
        begin = *end as usize;
    }
    all
}

/// Those of one edge each.
pub(super) fn by_edge(sides: &[Side]) -> impl Iterator<Item = &[Side]> {
    sides.chunk_by(|a, b| a.ends == b.ends)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn they_are_those_that_sorting_gives(faces in prop::collection::vec(prop::array::uniform3(0u32..20), 0..60)) {
            let numbered = || faces.iter().enumerate().map(|(number, corners)| (number as u32, *corners));
            let mut sorted = Vec::new();
            for (face, [a, b, c]) in numbered() {
                for (first, [p, q]) in [[a, b], [b, c], [c, a]].into_iter().enumerate() {
                    sorted.push(Side { ends: [p.min(q), p.max(q)], face, first: first as u32 });
                }
            }
            sorted.sort_unstable();
            prop_assert_eq!(sides(20, numbered()), sorted);
        }
    }
}
