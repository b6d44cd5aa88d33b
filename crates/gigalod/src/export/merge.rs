//! One number for each place: vertices of several nodes that lie at exactly the same place become one.
//!
//! Nodes share vertices only where a node's mesh ends, or triangles around the vertex are missing, so only vertices at borders are
//! remembered from one node to the next: memory grows with the seams, not with the surface. The same nodes in the same order get the
//! same numbers each time.

use gigalod_format::hybrid::{NodeRecord, Page};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Whole steps of the finest grid, from the root's origin.
type Place = [i64; 3];

/// Numbers that vertices at borders have got so far.
#[derive(Debug, Default)]
pub(super) struct Merge {
    at_borders: HashMap<Place, u32>,
}

/// Numbers of one node's vertices.
pub(super) struct Numbers {
    /// Of each vertex of the page.
    pub(super) of: Vec<u32>,
    /// Vertices of the page that are there for the first time; they have the next numbers, in this order.
    pub(super) new: Vec<u32>,
}

impl Merge {
    /// Numbers a node's vertices, when `next` of them have come before. `finer` levels are below the node's, to the finest.
    pub(super) fn number(&mut self, page: &Page, record: &NodeRecord, finer: u32, next: u64) -> Numbers {
        let vertices = record.vertices as usize;
        let mut is_at_border = vec![false; vertices];
        page.borders.as_flattened().iter().for_each(|vertex| is_at_border[*vertex as usize] = true);
        let mut own: HashMap<Place, u32> = HashMap::with_capacity(vertices);
        let mut numbers = Numbers { of: Vec::with_capacity(vertices), new: Vec::new() };
        for (vertex, at) in (0..).zip(&page.positions[..vertices]) {
            let place = [0, 1, 2].map(|axis| (i64::from(record.min_steps[axis]) + i64::from(at[axis])) << finer);
            // More than fit into 32 bits are refused before they are written.
            let fresh = (next + numbers.new.len() as u64) as u32;
            let number = match own.entry(place) {
                Entry::Occupied(known) => {
                    // Its like within the node may not have been at a border.
                    let number = *known.get();
                    if is_at_border[vertex as usize] {
                        self.at_borders.entry(place).or_insert(number);
                    }
                    number
                }
                Entry::Vacant(vacant) => {
                    let number = match is_at_border[vertex as usize] {
                        true => *self.at_borders.entry(place).or_insert(fresh),
                        false => fresh,
                    };
                    *vacant.insert(number)
                }
            };
            if number == fresh {
                numbers.new.push(vertex);
            }
            numbers.of.push(number);
        }
        numbers
    }
}
