//! From a coded page to its contents: four lanes in step, field by field, so that four chains of dependent look-ups overlap.
//!
//! In: bytes, the model's tables. Out: [`PageContents`], or `None`.
//! What always holds: bytes whatever end in contents of exactly as many nodes, families and links as asked for, or in `None`,
//! after work in proportion to these; mistakes are gathered and looked at in the end.

use super::super::contents::{RUN_BYTES, take_runs};
use super::super::links::{Link, MAX_RUNS, SKIP_ESCAPE};
use super::super::node::Node;
use super::super::{PageContents, PageRecord};
use super::context::Context;
use super::links::Contexts as LinkContexts;
use super::rans::{Reader, Slots, State, Words};
use super::tables::{ESCAPE, NONE, stepped, unfolded};
use super::{HEAD_BYTES, LANES};
use crate::bytes::Fields;
use std::iter;
use std::ops::Range;

/// What one lane has read, and where it writes.
struct Lane<'a> {
    state: State,
    context: Context,
    nodes: &'a mut [Node],
    colors: &'a mut [u16],
    /// Sizes of the groups, from the first on; those behind are never used.
    sizes: &'a mut [u8],
    groups: usize,
}

/// Undoes [`super::Encoder::encode`].
pub(super) fn decode(bytes: &[u8], slots: &Slots, record: &PageRecord, has_colors: bool) -> Option<PageContents> {
    let nodes = usize::from(record.nodes);
    let link_count = usize::from(record.words).checked_sub(nodes)?;
    let (head, rest) = bytes.split_first_chunk::<HEAD_BYTES>()?;
    let mut head = Fields(head);
    let states: [State; LANES] = std::array::from_fn(|_| State(head.u32()));
    let lengths: [usize; LANES - 1] = std::array::from_fn(|_| usize::from(head.u16()));
    let runs = usize::from(head.u8());
    if runs > MAX_RUNS {
        return None;
    }
    let (runs, rest) = rest.split_at_checked(runs * RUN_BYTES)?;
    let words = Words::new(rest)?;
    let mut words = words.reader();

    let mut contents = PageContents {
        group_sizes: vec![0; nodes],
        nodes: vec![Node(0); nodes],
        colors: vec![0; if has_colors { nodes } else { 0 }],
        family_groups: Vec::new(),
        runs: take_runs(runs),
        links: Vec::new(),
    };
    let mut rest = (&mut contents.nodes[..], &mut contents.colors[..], &mut contents.group_sizes[..]);
    let mut lane = |at: usize| {
        let (nodes, colors, sizes) = std::mem::take(&mut rest);
        let length = lengths.get(at).copied().unwrap_or(nodes.len());
        let (nodes, nodes_left) = nodes.split_at_mut_checked(length)?;
        let (colors, colors_left) = colors.split_at_mut(length.min(colors.len()));
        let (sizes, sizes_left) = sizes.split_at_mut(length);
        rest = (nodes_left, colors_left, sizes_left);
        Some(Lane { state: states[at], context: Context::default(), nodes, colors, sizes, groups: 0 })
    };
    let mut lanes = [lane(0)?, lane(1)?, lane(2)?, lane(3)?];
    let mut good = if has_colors {
        all_nodes::<true>(&mut lanes, slots, &mut words)
    } else {
        all_nodes::<false>(&mut lanes, slots, &mut words)
    };
    good &= lanes.iter().all(|lane| lane.context.begins_group());
    let groups = lanes.each_ref().map(|lane| (lane.groups, lane.nodes.len()));
    let mut states = lanes.map(|lane| lane.state);
    families_and_links(&mut states, slots, &mut words, usize::from(record.families), link_count, &mut contents);
    if !good || states != [State::END; LANES] || !words.is_at_end() {
        return None;
    }
    // Each lane's sizes begin where its nodes do.
    let (mut from, mut to) = (0, 0);
    for (groups, nodes) in groups {
        contents.group_sizes.copy_within(from..from + groups, to);
        (from, to) = (from + nodes, to + groups);
    }
    contents.group_sizes.truncate(to);
    Some(contents)
}

/// All lanes' nodes: in step as far as all have some, then the rest of each. False where there is a node that cannot be.
fn all_nodes<const COLORS: bool>(lanes: &mut [Lane<'_>; LANES], slots: &Slots, words: &mut Reader<'_>) -> bool {
    let all = lanes.iter().map(|lane| lane.nodes.len()).min().unwrap_or(0);
    let mut good = nodes::<LANES, COLORS>(lanes, slots, words, 0..all);
    for lane in lanes {
        let rest = all..lane.nodes.len();
        good &= nodes::<1, COLORS>(std::array::from_mut(lane), slots, words, rest);
    }
    good
}

/// Some nodes of some lanes, in step. What changes is kept in variables of its own, not behind references.
#[inline(always)]
fn nodes<const L: usize, const COLORS: bool>(
    lanes: &mut [Lane<'_>; L],
    slots: &Slots,
    shared_words: &mut Reader<'_>,
    range: Range<usize>,
) -> bool {
    let mut states = lanes.each_ref().map(|lane| lane.state);
    let mut contexts = lanes.each_ref().map(|lane| lane.context);
    let mut groups = lanes.each_ref().map(|lane| lane.groups);
    let mut words = *shared_words;
    let (mut good, mut spheres) = (true, 0);
    for at in range {
        for (state, context) in iter::zip(&mut states, &mut contexts) {
            context.set_kind(state.symbol(slots, &mut words, context.kind()));
        }
        for (state, context) in iter::zip(&mut states, &mut contexts) {
            context.set_cone_and_face(state.symbol(slots, &mut words, context.cone_and_face()));
        }
        let mut classes = [0; L];
        for ((state, context), classes) in iter::zip(&mut states, &contexts).zip(&mut classes) {
            *classes = state.symbol(slots, &mut words, context.classes());
        }
        for ((state, context), classes) in iter::zip(&mut states, &mut contexts).zip(classes) {
            let (of_column, of_row) = (classes >> 3, classes & 7);
            let bits = state.bits(&mut words, of_column + of_row);
            let guesses = context.guesses();
            let column = stepped(guesses[0], of_column, bits & ((1 << of_column) - 1));
            context.set_normal(column, stepped(guesses[1], of_row, bits >> of_column));
        }
        for (state, context) in iter::zip(&mut states, &mut contexts) {
            context.set_edge(state.symbol(slots, &mut words, context.edge()));
        }
        for (state, context) in iter::zip(&mut states, &mut contexts) {
            context.set_along_1(state.symbol(slots, &mut words, context.along_1()));
        }
        for (state, context) in iter::zip(&mut states, &mut contexts) {
            context.set_along_2(state.symbol(slots, &mut words, context.along_2()));
        }
        for (state, context) in iter::zip(&mut states, &mut contexts) {
            context.set_across(state.symbol(slots, &mut words, context.across()));
        }
        if COLORS {
            good &= colors(lanes, &mut states, &mut contexts, slots, &mut words, at);
        }
        for ((context, groups), lane) in contexts.iter_mut().zip(&mut groups).zip(lanes.iter_mut()) {
            let (last, size) = context.last_and_size();
            lane.sizes[*groups] = size as u8;
            *groups += last as usize;
            let (bits, sphere) = context.finish();
            lane.nodes[at] = Node(bits);
            spheres |= sphere;
        }
    }
    for (((lane, state), context), groups) in lanes.iter_mut().zip(states).zip(contexts).zip(groups) {
        (lane.state, lane.context, lane.groups) = (state, context, groups);
    }
    *shared_words = words;
    // A code that is none has a bit that no code has.
    good && spheres <= NONE / 2
}

/// The colours of one node in each lane.
#[inline(always)]
fn colors<const L: usize>(
    lanes: &mut [Lane<'_>; L],
    states: &mut [State; L],
    contexts: &mut [Context; L],
    slots: &Slots,
    words: &mut Reader<'_>,
    at: usize,
) -> bool {
    let mut good = true;
    let mut channel = |given: [(u32, i32); L], max: i32| -> [(i32, u32); L] {
        let mut found = [(0, 0); L];
        for ((state, (context, _)), found) in states.iter_mut().zip(given).zip(&mut found) {
            found.1 = state.symbol(slots, words, context);
        }
        for ((state, (_, guess)), (value, step)) in states.iter_mut().zip(given).zip(&mut found) {
            let escapes = *step == ESCAPE;
            let bits = state.bits(words, if escapes { 8 } else { 0 }) as i32;
            let at = if escapes { bits } else { guess + unfolded(*step) };
            good &= (0..=max).contains(&at);
            *value = at & max;
        }
        found
    };
    let greens = channel(contexts.each_ref().map(Context::green), 63);
    let mut at_lane = 0..L;
    let others = contexts.each_ref().map(|context| {
        let (green, step) = greens[at_lane.next().unwrap_or(0)];
        context.red_and_blue(green, step)
    });
    let reds = channel(others.map(|[red, _]| red), 31);
    let blues = channel(others.map(|[_, blue]| blue), 31);
    for (((lane, context), (red, _)), ((green, _), (blue, _))) in
        lanes.iter_mut().zip(contexts).zip(reds).zip(iter::zip(greens, blues))
    {
        context.set_color([red, green, blue]);
        lane.colors[at] = (red << 11 | green << 5 | blue) as u16;
    }
    good
}

/// Groups of families by the first lane; runs by the second and skips by the third, in turn.
fn families_and_links(
    states: &mut [State; LANES],
    slots: &Slots,
    words: &mut Reader<'_>,
    families: usize,
    links: usize,
    contents: &mut PageContents,
) {
    let [for_families, for_runs, for_skips, _] = states;
    let mut contexts = LinkContexts::default();
    contents.family_groups.reserve_exact(families + 1);
    for _ in 0..families.div_ceil(2) {
        let pair = for_families.symbol(slots, words, contexts.family());
        contexts.set_family(pair);
        contents.family_groups.extend([(pair >> 2 & 3) as u8 + 1, (pair & 3) as u8 + 1]);
    }
    contents.family_groups.truncate(families);
    contents.links.reserve_exact(links);
    for _ in 0..links {
        let run = for_runs.symbol(slots, words, contexts.run());
        let mut skip = for_skips.symbol(slots, words, contexts.skip(run));
        if skip == u32::from(SKIP_ESCAPE) {
            skip = for_skips.bits(words, 6) << 6;
            skip |= for_skips.bits(words, 6);
        }
        contexts.set_link(run, skip);
        contents.links.push(Link { run: run as u8, skip: skip as u16 });
    }
}
