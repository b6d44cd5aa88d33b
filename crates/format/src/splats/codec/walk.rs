//! The walk through a page: which symbol comes next, and what it depends on.

use super::super::node::{Children, Node};
use super::super::page::PageContents;
use super::model::first;
use gigalod_geom::quantise::{normal, sphere};
use sphere::Cells;

/// Counts, codes or decodes one symbol after the other.
pub(super) trait Coder {
    /// The next symbol, coded in `context`. `given` computes it from the known page; a decoder, who knows no page, does not ask.
    /// `None` ends the walk.
    fn symbol(&mut self, context: usize, given: impl FnOnce() -> u8) -> Option<u8>;
}

/// A difference too large for one symbol; the value itself follows.
const ESCAPE: u8 = 15;

/// Walks a page of `node_count` nodes: `given` when it is known, else an empty one; writes it to `out`.
pub(super) fn walk<C: Coder>(
    coder: &mut C,
    given: Option<&PageContents>,
    node_count: usize,
    has_colors: bool,
    out: &mut PageContents,
) -> Option<()> {
    out.clear();
    out.group_sizes.reserve(node_count / 3);
    out.nodes.reserve(node_count);
    out.colors.reserve(if has_colors { node_count } else { 0 });
    let tables = Tables { cells: sphere::cells_table(), normals: normal::table() };
    let mut before = Before::default();
    let mut group_at = 0;
    while out.nodes.len() < node_count {
        let given_size = || given.map_or(0, |page| page.group_sizes[group_at] - 1);
        let size = coder.symbol(first::GROUP + usize::from(before.group_size), given_size)? + 1;
        if size > 4 || out.nodes.len() + usize::from(size) > node_count {
            return None;
        }
        before.begin_group(size);
        for place in 0..usize::from(size) {
            let at = out.nodes.len();
            let node = node(coder, &tables, &mut before, place, given.map_or(Node(0), |page| page.nodes[at]))?;
            out.nodes.push(node);
            if has_colors {
                let given = given.map_or(0, |page| page.colors[at]);
                out.colors.push(color(coder, &mut before, place, given)?);
            }
        }
        out.group_sizes.push(size);
        group_at += 1;
    }
    Some(())
}

struct Tables {
    cells: &'static [Cells],
    normals: &'static [glam::Vec3],
}

/// What was walked before, as far as it tells of what comes.
#[derive(Default)]
struct Before {
    /// Of the group before; then of this one.
    group_size: u8,
    /// Of the node before in this group: 0 none, 1 leaf, 2 inner.
    tree: usize,
    cone: u8,
    /// Edge of the node before in this group; 0 for none.
    edge: u8,
    /// Sums of doubled offsets of the nodes before in this group.
    offsets: [i32; 3],
    normal: MeanNormal,
    color: [i32; 3],
}

impl Before {
    fn begin_group(&mut self, size: u8) {
        self.group_size = size;
        self.tree = 0;
        self.edge = 0;
        self.offsets = [0; 3];
        self.normal.begin_group();
    }
}

/// Mean column and row of the latest normals that share a face, within a group.
#[derive(Default)]
struct MeanNormal {
    face: i32,
    column: i32,
    row: i32,
    count: i32,
    /// The next normal begins a group: it is compared with the mean, and then replaces it.
    fresh: bool,
}

impl MeanNormal {
    fn begin_group(&mut self) {
        self.fresh = true;
    }

    /// Face, column and row that are most likely next.
    fn guess(&self) -> [i32; 3] {
        // Rounded sums over 1, 2, 3 and 4, as products with 2^16 over the number.
        const SHARE: [i32; 5] = [1 << 16, 1 << 16, 1 << 15, 21_846, 1 << 14];
        let mean = |sum: i32| (sum * SHARE[self.count as usize] + (1 << 15)) >> 16;
        [self.face, mean(self.column), mean(self.row)]
    }

    fn add(&mut self, [face, column, row]: [i32; 3]) {
        if self.fresh || face != self.face || self.count == 4 {
            *self = Self { face, column, row, count: 1, fresh: false };
        } else {
            self.column += column;
            self.row += row;
            self.count += 1;
        }
    }
}

#[inline(always)]
fn node<C: Coder>(coder: &mut C, tables: &Tables, before: &mut Before, place: usize, given: Node) -> Option<Node> {
    // 0–3 a leaf with that cone; 4–6 an inner node with 2–4 children; 7–9 likewise, and all of them are leaves.
    let kind = || {
        let children = given.children();
        match children.count {
            0 => given.cone(),
            count => count + if children.all_leaves { 5 } else { 2 },
        }
    };
    let kind = coder.symbol(first::KIND + (place * 3 + before.tree) * 4 + usize::from(before.cone), kind)?;
    if kind > 9 {
        return None;
    }
    let inner = usize::from(kind > 3);
    let (children, cone) = if inner == 0 {
        (Children::NONE, kind)
    } else {
        let all_leaves = kind > 6;
        let count = kind - if all_leaves { 5 } else { 2 };
        (Children { count, all_leaves }, coder.symbol(first::CONE + usize::from(before.cone), || given.cone())?)
    };
    if cone > 3 {
        return None;
    }
    before.tree = 1 + inner;
    before.cone = cone;

    let normal_code = direction(coder, before, place, cone, given.normal())?;
    let sphere_code = ball(coder, tables, before, inner, normal_code, given.sphere())?;
    Some(Node::pack(sphere_code, normal_code, cone, children))
}

#[inline(always)]
fn direction<C: Coder>(coder: &mut C, before: &mut Before, place: usize, cone: u8, given: u16) -> Option<u16> {
    const GRID: i32 = normal::GRID as i32;
    let parts = |code: u16| [i32::from(code) / (GRID * GRID), i32::from(code) % GRID, i32::from(code) / GRID % GRID];
    let guess = before.normal.guess();
    let step = |part: usize| folded(parts(given)[part] - guess[part]);
    let column_or_escape = || {
        let escapes = parts(given)[0] != guess[0] || step(1) >= ESCAPE || step(2) >= ESCAPE;
        if escapes { ESCAPE } else { step(1) }
    };
    let context = usize::from(cone) * 2 + usize::from(place > 0);
    let column_step = coder.symbol(first::COLUMN + context, column_or_escape)?;
    let (code, parts) = if column_step == ESCAPE {
        let code = plain(coder, || given, 4)?;
        (code, parts(code))
    } else {
        let row_step = coder.symbol(first::ROW + context * 4 + size_class(column_step), || step(2))?;
        let (column, row) = (guess[1] + unfolded(column_step), guess[2] + unfolded(row_step));
        if !(0..GRID).contains(&column) || !(0..GRID).contains(&row) {
            return None;
        }
        (((guess[0] * GRID + row) * GRID + column) as u16, [guess[0], column, row])
    };
    if usize::from(code) >= normal::CODES {
        return None;
    }
    before.normal.add(parts);
    Some(code)
}

#[inline(always)]
fn ball<C: Coder>(
    coder: &mut C,
    tables: &Tables,
    before: &mut Before,
    inner: usize,
    normal_code: u16,
    given: u16,
) -> Option<u16> {
    let given = || tables.cells[usize::from(given).min(sphere::CODES - 1)];
    let edge = coder.symbol(first::EDGE + inner * 14 + usize::from(before.edge), || given().edge - 1)? + 1;
    if edge > sphere::GRID as u8 {
        return None;
    }
    let by_edge = usize::from(edge) - 1;
    let places = sphere::GRID as u8 + 1 - edge;
    let first_in_group = before.edge == 0;

    // The surface lies across the axis that its normal is closest to.
    let across = usize::from(normal_code) / (normal::GRID * normal::GRID * 2);
    let (along_1, along_2) = ((across + 1) % 3, (across + 2) % 3);
    let mut cells = Cells { edge, corner: [0; 3] };
    let siblings = |axis: usize| if first_in_group { 0 } else { 1 + side_class(before.offsets[axis]) };

    cells.corner[along_1] =
        coder.symbol(first::ALONG_1 + by_edge * 6 + siblings(along_1), || given().corner[along_1])?;
    let out = (cells.doubled_offset(along_1).unsigned_abs() as usize / 3).min(2);
    let context = (by_edge * 6 + siblings(along_2)) * 3 + out;
    cells.corner[along_2] = coder.symbol(first::ALONG_2 + context, || given().corner[along_2])?;
    if cells.corner[along_1] >= places || cells.corner[along_2] >= places {
        return None;
    }

    // Where the tangent plane through the parent's centre passes, in doubled cells.
    let normal = tables.normals[usize::from(normal_code)];
    let on_plane = -(normal[along_1] * cells.doubled_offset(along_1) as f32
        + normal[along_2] * cells.doubled_offset(along_2) as f32)
        / normal[across];
    let guess = (((on_plane + f32::from(places - 1)) * 0.5).clamp(0.0, f32::from(places - 1)) + 0.5) as u8;
    let step = || (given().corner[across] + places - guess) % places;
    let step = coder.symbol(first::ACROSS + by_edge * 2 + inner, step)?;
    if step >= places {
        return None;
    }
    let corner = guess + step;
    cells.corner[across] = if corner >= places { corner - places } else { corner };

    before.edge = edge;
    for axis in 0..3 {
        before.offsets[axis] += cells.doubled_offset(axis);
    }
    sphere::code_of(cells)
}

fn color<C: Coder>(coder: &mut C, before: &mut Before, place: usize, given: u16) -> Option<u16> {
    let given = [i32::from(given >> 11), i32::from(given >> 5 & 63), i32::from(given & 31)];
    let [red_before, green_before, blue_before] = before.color;
    let (green, green_step) = channel(coder, first::GREEN + usize::from(place > 0), green_before, given[1], 63)?;
    let class = size_class(green_step);
    // Grey stays grey: red and blue are expected to move by half of what green, which counts in finer steps, moves.
    let moved = (green - green_before) / 2;
    let (red, _) = channel(coder, first::RED + class, (red_before + moved).clamp(0, 31), given[0], 31)?;
    let (blue, _) = channel(coder, first::BLUE + class, (blue_before + moved).clamp(0, 31), given[2], 31)?;
    before.color = [red, green, blue];
    Some((red << 11 | green << 5 | blue) as u16)
}

/// One channel as a difference; returns its value and the symbol.
fn channel<C: Coder>(coder: &mut C, context: usize, guess: i32, given: i32, max: i32) -> Option<(i32, u8)> {
    let step = coder.symbol(context, || folded(given - guess).min(ESCAPE))?;
    let value = if step == ESCAPE { i32::from(plain(coder, || given as u16, 2)?) } else { guess + unfolded(step) };
    (0..=max).contains(&value).then_some((value, step))
}

/// So many times four bits as they are, highest first.
fn plain<C: Coder>(coder: &mut C, given: impl Fn() -> u16, nibbles: u32) -> Option<u16> {
    (0..nibbles).rev().try_fold(0, |value, nibble| {
        Some(value << 4 | u16::from(coder.symbol(first::PLAIN, || (given() >> (4 * nibble) & 15) as u8)?))
    })
}

/// 0, −1, 1, −2, 2 … as 0, 1, 2, 3, 4 …; saturates at 255.
fn folded(step: i32) -> u8 {
    (if step < 0 { -2 * step - 1 } else { 2 * step }).min(255) as u8
}

fn unfolded(code: u8) -> i32 {
    let half = i32::from(code.div_ceil(2));
    if code % 2 == 1 { -half } else { half }
}

/// How large a folded difference is, in four classes: none, up to 1, up to 3, more.
fn size_class(folded: u8) -> usize {
    match folded {
        0 => 0,
        1..=2 => 1,
        3..=6 => 2,
        _ => 3,
    }
}

/// On which side of the middle siblings lie, in five classes.
fn side_class(sum: i32) -> usize {
    match sum {
        ..-8 => 0,
        -8..-2 => 1,
        -2..=2 => 2,
        3..=8 => 3,
        _ => 4,
    }
}
