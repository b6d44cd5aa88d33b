//! From a known page to its symbols, lane by lane: for counting and coding.
//!
//! In: [`PageContents`]. Out: for each lane the symbols in order.
//! What always holds: any contents can be listed; what a page cannot hold (sphere and normal codes beyond the last) is taken for
//! the last code.

use super::super::PageContents;
use super::super::links::SKIP_ESCAPE;
use super::super::node::Node;
use super::LANES;
use super::context::Context;
use super::links::Contexts as LinkContexts;
use super::rans::{ROW, entry_of_bits};
use super::tables::{ESCAPE, classed, folded};
use gigalod_geom::quantise::{normal, sphere};
use std::ops::Range;

/// What is taken for a symbol in a context, or for a number of some bits.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Symbol(pub(super) u16);

impl Symbol {
    #[inline(always)]
    fn new(context: u32, symbol: u32) -> Self {
        Self((context * ROW as u32 + symbol) as u16)
    }

    #[inline(always)]
    fn bits(bits: u32, value: u32) -> Self {
        Self(entry_of_bits(bits, value))
    }
}

/// Symbols of a node: as many for each.
pub(super) const OF_NODE: usize = 8;
/// Of its colour.
pub(super) const OF_COLOR: usize = 6;

/// Takes the symbols of nodes, one after the other.
struct Sink<'a, F>(&'a mut F);

impl<F: FnMut(Symbol)> Sink<'_, F> {
    #[inline(always)]
    fn put(&mut self, context: u32, symbol: u32) {
        self.0(Symbol::new(context, symbol));
    }

    #[inline(always)]
    fn put_bits(&mut self, bits: u32, value: u32) {
        self.0(Symbol::bits(bits, value));
    }
}

/// Lists the nodes of all lanes of a page, a lane after the other; returns the nodes of each.
pub(super) fn list_nodes(contents: &PageContents, mut put: impl FnMut(Symbol)) -> [usize; LANES] {
    let cells = sphere::cells_table();
    let mut lengths = [0; LANES];
    let mut groups = contents.group_sizes.iter();
    let mut at = 0;
    for (lane, length) in lengths.iter_mut().enumerate() {
        // Up to the first group that ends at or behind the lane's share.
        let end = (contents.nodes.len() * (lane + 1)).div_ceil(LANES);
        let begin = at;
        let mut context = Context::default();
        while at < end
            && let Some(size) = groups.next()
        {
            let group = at..at + usize::from(*size);
            at = group.end;
            list_group(contents, group, cells, &mut context, &mut Sink(&mut put));
        }
        *length = at - begin;
    }
    lengths
}

#[inline(always)]
fn list_group(
    contents: &PageContents,
    group: Range<usize>,
    cells: &[sphere::Cells],
    context: &mut Context,
    sink: &mut Sink<'_, impl FnMut(Symbol)>,
) {
    let last = group.end - 1;
    for at in group {
        let node = contents.nodes[at];
        list_node(node, at == last, cells, context, sink);
        if let Some(color) = contents.colors.get(at) {
            list_color(*color, context, sink);
        }
        let (bits, _) = context.finish();
        debug_assert!(bits == node.0, "a node lists to itself");
    }
}

#[inline(always)]
fn list_node(
    node: Node,
    last: bool,
    cells: &[sphere::Cells],
    context: &mut Context,
    sink: &mut Sink<'_, impl FnMut(Symbol)>,
) {
    const GRID: u32 = normal::GRID as u32;
    // A leaf's lowest bit says nothing.
    let tree = if node.is_leaf() { 0 } else { node.0 & 7 };
    let kind = 2 * tree + u32::from(last);
    sink.put(context.kind(), kind);
    context.set_kind(kind);
    let code = u32::from(node.normal()).min(normal::CODES as u32 - 1);
    let (face, row, column) = (code / (GRID * GRID), code / GRID % GRID, code % GRID);
    let cone_and_face = context.turn_to(face) << 2 | u32::from(node.cone());
    sink.put(context.cone_and_face(), cone_and_face);
    context.set_cone_and_face(cone_and_face);
    let guesses = context.guesses();
    let (of_column, column_bits) = classed(guesses[0], column);
    let (of_row, row_bits) = classed(guesses[1], row);
    sink.put(context.classes(), of_column << 3 | of_row);
    sink.put_bits(of_column + of_row, row_bits << of_column | column_bits);
    context.set_normal(column, row);

    let mut put = |context: u32, symbol: u32| sink.put(context, symbol);
    let cells = cells[usize::from(node.sphere()).min(sphere::CODES - 1)];
    let axis = face as usize >> 1;
    let [across, along_1, along_2] = [axis, (axis + 1) % 3, (axis + 2) % 3].map(|axis| u32::from(cells.corner[axis]));
    put(context.edge(), u32::from(cells.edge) - 1);
    context.set_edge(u32::from(cells.edge) - 1);
    put(context.along_1(), along_1);
    context.set_along_1(along_1);
    put(context.along_2(), along_2);
    context.set_along_2(along_2);
    let (guess, places) = (context.across_guess(), context.places());
    let step = if across >= guess { across - guess } else { across + places - guess };
    put(context.across(), step);
    context.set_across(step);
}

fn list_color(color: u16, context: &mut Context, sink: &mut Sink<'_, impl FnMut(Symbol)>) {
    let [red, green, blue] = [color >> 11, color >> 5 & 63, color & 31].map(i32::from);
    let mut channel = |(context, guess): (u32, i32), value: i32| {
        let step = folded(value - guess);
        sink.put(context, step);
        if step == ESCAPE {
            sink.put_bits(8, value as u32)
        } else {
            sink.put_bits(0, 0)
        }
        step
    };
    let step = channel(context.green(), green);
    let [red_context, blue_context] = context.red_and_blue(green, step);
    channel(red_context, red);
    channel(blue_context, blue);
    context.set_color([red, green, blue]);
}

/// Groups of families by the first lane; runs by the second and skips by the third, in turn.
pub(super) fn list_links(contents: &PageContents, mut put: impl FnMut(usize, Symbol)) {
    let mut contexts = LinkContexts::default();
    for pair in contents.family_groups.chunks(2) {
        let second = pair.get(1).map_or(0, |groups| groups - 1);
        let pair = u32::from((pair[0] - 1) << 2 | second);
        put(0, Symbol::new(contexts.family(), pair));
        contexts.set_family(pair);
    }
    for link in &contents.links {
        let (run, skip) = (u32::from(link.run), u32::from(link.skip));
        put(1, Symbol::new(contexts.run(), run));
        put(2, Symbol::new(contexts.skip(run), skip.min(u32::from(SKIP_ESCAPE))));
        if link.skip >= SKIP_ESCAPE {
            put(2, Symbol::bits(6, skip >> 6));
            put(2, Symbol::bits(6, skip & 63));
        }
        contexts.set_link(run, skip);
    }
}
