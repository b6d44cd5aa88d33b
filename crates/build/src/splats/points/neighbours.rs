//! The nearest sites of each site of a cell, in the whole cloud.
//!
//! A cell and its number go in; for each of its sites, a list of the nearest others comes out. They are looked for in the cell
//! itself, then in those other cells that are near enough to have a nearer one: the nearest cell first, and only the part of it
//! that matters.

use super::cells::{Cell, Cells, Site};
use super::nearest::{Box3, Key, Tree, key, larger, number_of, square_of};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::io;

/// Boxes of all cells and of runs of them, to find near ones.
pub(super) struct CellBoxes {
    /// The first are the cells'; each next list has the boxes of pairs of the one before; the last has one.
    levels: Vec<Vec<Box3>>,
}

impl CellBoxes {
    pub(super) fn of(cells: &[Cell]) -> Self {
        let mut levels = vec![cells.iter().map(|cell| Box3 { min: cell.min, max: cell.max }).collect::<Vec<_>>()];
        while levels[levels.len() - 1].len() > 1 {
            let below = &levels[levels.len() - 1];
            let above = below.chunks(2).map(|pair| pair.iter().fold(Box3::EMPTY, |all, one| all.union(one))).collect();
            levels.push(above);
        }
        Self { levels }
    }
}

/// How much larger the square of a site's reach may be than that of the one before, so that it is found at once.
const GUESS: f32 = 1.3;

/// Lists of neighbours. Those of a cell's own sites have their numbers there; others follow them.
#[derive(Default)]
pub(super) struct Lists {
    /// Each list's keys, nearest first, a fixed number of places each.
    keys: Vec<Key>,
    lens: Vec<u8>,
    most: usize,
}

impl Lists {
    fn reset(&mut self, lists: usize, most: usize) {
        self.keys.clear();
        self.keys.resize(lists * most, 0);
        self.lens.clear();
        self.lens.resize(lists, 0);
        self.most = most;
    }

    pub(super) fn list(&self, number: usize) -> &[Key] {
        &self.keys[number * self.most..][..usize::from(self.lens[number])]
    }

    fn set(&mut self, number: usize, keys: &[Key]) {
        self.keys[number * self.most..][..keys.len()].copy_from_slice(keys);
        self.lens[number] = keys.len() as u8;
    }

    /// Square of the distance beyond which nothing is of interest.
    fn reach(&self, number: usize) -> f32 {
        let list = self.list(number);
        if list.len() < self.most { f32::INFINITY } else { square_of(list[self.most - 1]) }
    }
}

/// A cell's sites, and those of others that are neighbours of them.
#[derive(Default)]
pub(super) struct Pool {
    pub(super) at: Vec<Site>,
    /// The cell's own are the first.
    pub(super) own: usize,
    first_site: u32,
    /// Of the others, their numbers in the cloud.
    foreign: Vec<u32>,
    /// And their places in the pool.
    places: HashMap<u32, u32>,
    pub(super) tree: Tree,
    other_sites: Vec<Site>,
    strip: Vec<Site>,
    strip_numbers: Vec<u32>,
    strip_tree: Tree,
    found: Vec<Key>,
    probes: Vec<Probe>,
}

/// A list that other cells may add to.
#[derive(Clone, Copy)]
struct Probe {
    at: Site,
    first_reach: f32,
    /// As it is now.
    reach: f32,
    list: u32,
}

impl Pool {
    /// Reads a cell.
    pub(super) fn read(&mut self, cells: &Cells, cell: usize) -> io::Result<()> {
        let Cell { sites, first_site, .. } = cells.cells[cell];
        cells.sites.read_vec(u64::from(first_site), sites as usize, &mut self.at)?;
        self.own = sites as usize;
        self.first_site = first_site;
        self.foreign.clear();
        self.places.clear();
        self.tree.build(&self.at);
        Ok(())
    }

    /// A site's number in the cloud.
    pub(super) fn number_in_cloud(&self, site: u32) -> u32 {
        match (site as usize).checked_sub(self.own) {
            None => self.first_site + site,
            Some(foreign) => self.foreign[foreign],
        }
    }

    /// Lists the nearest `most` of each of some of the cell's sites, itself left out.
    pub(super) fn neighbours(
        &mut self,
        cells: &Cells,
        boxes: &CellBoxes,
        cell: usize,
        asked: &[u32],
        most: usize,
        lists: &mut Lists,
    ) -> io::Result<()> {
        lists.reset(asked.len(), most);
        let mut found = std::mem::take(&mut self.found);
        let mut guess = f32::INFINITY;
        for (list, site) in asked.iter().enumerate() {
            let at = self.at[*site as usize];
            // A little more than the last one needed. If that is too little, all.
            self.tree.nearest(at, most + 1, guess, &mut found);
            if found.len() <= most && guess < f32::INFINITY {
                self.tree.nearest(at, most + 1, 4.0 * guess, &mut found);
                if found.len() <= most {
                    self.tree.nearest(at, most + 1, f32::INFINITY, &mut found);
                }
            }
            guess = if found.len() > most { square_of(found[most]) * GUESS } else { f32::INFINITY };
            found.retain(|key| number_of(*key) != *site);
            found.truncate(most);
            lists.set(list, &found);
        }
        self.found = found;
        self.look_around(cells, boxes, cell, asked, lists)
    }

    /// Looks into other cells.
    fn look_around(
        &mut self,
        cells: &Cells,
        boxes: &CellBoxes,
        cell: usize,
        asked: &[u32],
        lists: &mut Lists,
    ) -> io::Result<()> {
        // Widest reach first: far cells matter to few.
        let mut probes = std::mem::take(&mut self.probes);
        probes.clear();
        probes.extend((0..asked.len()).map(|list| Probe {
            at: self.at[asked[list] as usize],
            first_reach: lists.reach(list),
            reach: lists.reach(list),
            list: list as u32,
        }));
        probes.sort_unstable_by(|a, b| b.reach.total_cmp(&a.reach).then(a.list.cmp(&b.list)));
        let own_box = boxes.levels[0][cell];
        // Squares of distances as bits, which are in their order; level; number.
        let mut heap = BinaryHeap::from([Reverse((0_u32, boxes.levels.len() - 1, 0_usize))]);
        let mut needy: Vec<u32> = Vec::new();
        let mut bound = f32::INFINITY;
        while let Some(Reverse((square, level, number))) = heap.pop() {
            let square = f32::from_bits(square);
            // By what they were at the beginning; reaches only shrink.
            let might = probes.partition_point(|probe| probe.first_reach >= square);
            if might == 0 || square > bound {
                break;
            }
            if level > 0 {
                for child in 2 * number..(2 * number + 2).min(boxes.levels[level - 1].len()) {
                    let square = boxes.levels[level - 1][child].square_to(&own_box);
                    heap.push(Reverse((square.to_bits(), level - 1, child)));
                }
                continue;
            }
            if number == cell {
                continue;
            }
            let other_box = boxes.levels[0][number];
            needy.clear();
            let (mut around, mut widest) = (Box3::EMPTY, 0.0_f32);
            bound = 0.0;
            for (number, Probe { at, reach, .. }) in probes[..might].iter().enumerate() {
                bound = larger(bound, *reach);
                if other_box.square(*at) <= *reach {
                    needy.push(number as u32);
                    around = around.including(*at);
                    widest = larger(widest, *reach);
                }
            }
            if needy.is_empty() {
                continue;
            }
            self.look_into(cells, number, &mut probes, &needy, &around, widest, lists)?;
        }
        self.probes = probes;
        Ok(())
    }

    /// Looks for nearer ones of the `needy` in another cell; these are in a box, and reach no farther than a square.
    #[allow(clippy::too_many_arguments, reason = "the inside of the function above")]
    fn look_into(
        &mut self,
        cells: &Cells,
        other: usize,
        probes: &mut [Probe],
        needy: &[u32],
        around: &Box3,
        widest: f32,
        lists: &mut Lists,
    ) -> io::Result<()> {
        let Cell { sites, first_site, .. } = cells.cells[other];
        cells.sites.read_vec(u64::from(first_site), sites as usize, &mut self.other_sites)?;
        self.strip.clear();
        self.strip_numbers.clear();
        for (number, site) in self.other_sites.iter().enumerate() {
            if around.square(*site) <= widest {
                self.strip.push(*site);
                self.strip_numbers.push(first_site + number as u32);
            }
        }
        if self.strip.is_empty() {
            return Ok(());
        }
        self.strip_tree.build(&self.strip);
        let mut found = std::mem::take(&mut self.found);
        for number in needy {
            let probe = &mut probes[*number as usize];
            let list = probe.list as usize;
            self.strip_tree.nearest(probe.at, lists.most, probe.reach, &mut found);
            if found.is_empty() {
                continue;
            }
            // What ties with the last of the list is behind it, whatever its number.
            for found in &mut found {
                *found = key(square_of(*found), u32::MAX - number_of(*found));
            }
            found.extend_from_slice(lists.list(list));
            found.sort_unstable();
            found.truncate(lists.most);
            for found in &mut found {
                let strip = u32::MAX - number_of(*found);
                if (strip as usize) < self.strip.len() {
                    *found = key(square_of(*found), self.take(strip));
                }
            }
            found.sort_unstable();
            lists.set(list, &found);
            probe.reach = lists.reach(list);
        }
        self.found = found;
        Ok(())
    }

    /// The place in the pool of a site of the strip.
    fn take(&mut self, strip: u32) -> u32 {
        let number = self.strip_numbers[strip as usize];
        *self.places.entry(number).or_insert_with(|| {
            self.foreign.push(number);
            self.at.push(self.strip[strip as usize]);
            (self.at.len() - 1) as u32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spool::{Place, Spool};
    use proptest::prelude::*;

    /// Cells of a few sites each, in no order of space.
    fn cells_of(sites: &[Site], per_cell: usize) -> Cells {
        let mut spool = Spool::new(&Place::Memory).unwrap();
        spool.push(sites).unwrap();
        let cell = |(number, sites): (usize, &[Site])| {
            let Box3 { min, max } = sites.iter().fold(Box3::EMPTY, |all, site| all.including(*site));
            let count = sites.len() as u32;
            Cell { points: count, sites: count, first_site: (number * per_cell) as u32, min, max }
        };
        Cells {
            points: Spool::new(&Place::Memory).unwrap(),
            sites: spool,
            cells: sites.chunks(per_cell).enumerate().map(cell).collect(),
            scale: 1.0,
            has_normals: false,
        }
    }

    proptest! {
        #[test]
        fn neighbours_are_the_nearest_of_the_whole_cloud(
            mut sites in prop::collection::vec(prop::array::uniform3((-9i32..9).prop_map(|x| x as f32 * 0.25)), 1..300),
            per_cell in 1usize..60, most in 1usize..20, sort in any::<bool>(),
        ) {
            if sort {
                sites.sort_by(|a, b| a.partial_cmp(b).unwrap());
                sites.dedup();
            }
            let cells = cells_of(&sites, per_cell);
            let boxes = CellBoxes::of(&cells.cells);
            let (mut pool, mut lists) = (Pool::default(), Lists::default());
            for cell in 0..cells.cells.len() {
                pool.read(&cells, cell).unwrap();
                let asked: Vec<u32> = pool.tree.sites().collect();
                pool.neighbours(&cells, &boxes, cell, &asked, most, &mut lists).unwrap();
                for (list, site) in asked.iter().enumerate() {
                    let number = pool.number_in_cloud(*site);
                    let at = sites[number as usize];
                    let square = |other: &Site| {
                        let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| other[axis] - at[axis]);
                        x * x + y * y + z * z
                    };
                    let mut squares: Vec<f32> = (0..sites.len())
                        .filter(|other| *other != number as usize)
                        .map(|other| square(&sites[other]))
                        .collect();
                    squares.sort_by(f32::total_cmp);
                    squares.truncate(most);
                    let found = lists.list(list);
                    prop_assert!(found.iter().map(|key| square_of(*key)).eq(squares));
                    let mut numbers: Vec<u32> = Vec::new();
                    for key in found {
                        let found = pool.number_in_cloud(number_of(*key));
                        prop_assert_eq!(sites[found as usize], pool.at[number_of(*key) as usize]);
                        prop_assert_eq!(square(&sites[found as usize]), square_of(*key));
                        numbers.push(found);
                    }
                    numbers.sort_unstable();
                    numbers.dedup();
                    prop_assert!(numbers.len() == found.len() && !numbers.contains(&number));
                }
            }
        }
    }
}
