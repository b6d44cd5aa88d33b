//! Walks the body of a file, element by element and item by item, and fills batches.
//!
//! In: the plan and the body. Out: a [`ModelStream`]. The way of [`PlyStream::read_item`], value by value, reads everything
//! there is; where the plan has a [`Block`](super::block::Block), most items take the short cut.
//!
//! What always holds: one number of the file is in hand at a time, so a list may be of any length; an item stops halfway when
//! a batch is full, and goes on in the next.

use super::{
    corners::{Corners, Topology},
    header::{Property, Shape},
    plan::{Body, Content, Section},
    values::{At, Values},
    vertex::Row,
};
use crate::{
    Attributes, Batch, ImportError, ModelStream,
    error::{Problem, shown},
    input::Input,
};

pub(super) struct PlyStream<V> {
    input: Input,
    body: Body,
    values: V,
    /// Number of the section being read.
    section: usize,
    /// Number of the item being read in it.
    item: u64,
    part: Part,
}

/// How far the item being read is.
#[derive(Default)]
struct Part {
    /// Number of the next property.
    property: usize,
    /// Values that its list still has; none when its length is yet to be read.
    list_left: Option<u64>,
    corners: Corners,
    row: Row,
}

impl<V: Values> PlyStream<V> {
    /// `input` stands at the first byte of the body.
    pub(super) fn new(input: Input, body: Body, values: V) -> Self {
        Self { input, body, values, section: 0, item: 0, part: Part::default() }
    }

    /// Reads what is left of an item, or as much of it as fits the batch.
    fn read_item(&mut self, batch: &mut Batch) -> Result<(), ImportError> {
        let Self { input, values, part, .. } = self;
        let Section { element, content, slots, .. } = &self.body.sections[self.section];
        let vertex_count = self.body.vertex_count;
        let at = |property: usize| At { element, item: self.item, property: &element.properties[property] };
        if part.property == 0 && part.list_left.is_none() {
            values.begin_item(input);
        }
        while part.property < element.properties.len() {
            let at = at(part.property);
            match at.property.shape {
                Shape::Single(scalar) => match slots[part.property] {
                    Some(slot) => part.row[slot] = values.number(input, scalar, at)?,
                    None => values.skip(input, scalar, 1, at)?,
                },
                Shape::List { length, value } => {
                    let left = match part.list_left {
                        Some(left) => left,
                        None => list_length(values.number(input, length, at)?, at.property)
                            .map_err(|problem| error(values, problem, at))?,
                    };
                    match *content {
                        Content::Corners { list, topology } if list == part.property => {
                            for read in 0..left {
                                if batch.is_full() {
                                    part.list_left = Some(left - read);
                                    return Ok(());
                                }
                                match corner(values.number(input, value, at)?, topology, vertex_count) {
                                    Ok(Some(vertex)) => batch.triangles.extend(part.corners.add(topology, vertex)),
                                    Ok(None) => part.corners.restart(),
                                    Err(problem) => return Err(error(values, problem, at)),
                                }
                            }
                        }
                        _ => values.skip(input, value, left, at)?,
                    }
                    part.list_left = None;
                }
            }
            part.property += 1;
        }
        let at = at(element.properties.len() - 1);
        if let Content::Vertices(channels) = content
            && !channels.push(&part.row, &mut batch.vertices)
        {
            let [x, y, z, ..] = part.row;
            let problem = Problem::NotFinite { position: [x, y, z] };
            return Err(error(values, problem, at));
        }
        values.end_item(input, at)?;
        self.part = Part::default();
        self.item += 1;
        Ok(())
    }
}

impl<V: Values> ModelStream for PlyStream<V> {
    fn attributes(&self) -> Attributes {
        self.body.attributes
    }

    fn declared_vertices(&self) -> Option<u64> {
        Some(self.body.vertex_count)
    }

    fn declared_faces(&self) -> Option<u64> {
        self.body.face_count
    }

    fn next(&mut self, batch: &mut Batch) -> Result<bool, ImportError> {
        batch.clear();
        while let Some(section) = self.body.sections.get(self.section) {
            let left = section.element.count - self.item;
            if left == 0 || section.element.properties.is_empty() {
                (self.section, self.item) = (self.section + 1, 0);
                continue;
            }
            if batch.is_full() {
                return Ok(true);
            }
            if self.part.property == 0 && self.part.list_left.is_none() {
                let items = self.values.read_block(&mut self.input, section, left, batch);
                self.item += items;
                if items > 0 {
                    continue;
                }
            }
            self.read_item(batch)?;
        }
        self.input.finish()?;
        Ok(!batch.vertices.positions.is_empty() || !batch.triangles.is_empty())
    }

    fn bytes_consumed(&self) -> (u64, u64) {
        self.input.progress()
    }
}

/// The vertex that a number in a list of corners stands for; none for a restart.
#[inline]
fn corner(number: f64, topology: Topology, vertex_count: u64) -> Result<Option<u32>, Problem> {
    let vertex = number as u32;
    if f64::from(vertex) == number && u64::from(vertex) < vertex_count {
        Ok(Some(vertex))
    } else if topology == Topology::Strip && (number == -1.0 || number == f64::from(u32::MAX)) {
        // `uint` has no -1, but as there are fewer than 2³² vertices, its largest value is none of them.
        Ok(None)
    } else if number.fract() == 0.0 {
        Err(Problem::IndexOutOfRange { index: number, vertex_count })
    } else {
        Err(Problem::Malformed { expected: "a whole vertex number".to_owned(), found: number.to_string() })
    }
}

fn list_length(number: f64, list: &Property) -> Result<u64, Problem> {
    let length = number as u64;
    if length as f64 == number {
        return Ok(length);
    }
    let expected = format!("the length of the list `{}`", shown(list.name.as_bytes()));
    Err(Problem::Malformed { expected, found: number.to_string() })
}

fn error(values: &impl Values, problem: Problem, at: At<'_>) -> ImportError {
    ImportError::new(problem, Some(at.place(values.place())))
}
