//! What the elements of a file mean, decided once, before its body is read.
//!
//! In: the elements of a header. Out: a [`Body`], one [`Section`] for each element in file order. Every check that needs no
//! value is made here.

use super::{
    block::Block,
    corners::Topology,
    header::{Element, Property, Shape},
    vertex::Channels,
};
use crate::{Attributes, ImportError, Place, error::shown};

pub(super) struct Body {
    pub(super) sections: Vec<Section>,
    pub(super) attributes: Attributes,
    /// Below 2³².
    pub(super) vertex_count: u64,
    /// Polygons; none where there are strips, which do not say how many triangles they make.
    pub(super) face_count: Option<u64>,
}

/// An element and what to do with it.
pub(super) struct Section {
    pub(super) element: Element,
    pub(super) content: Content,
    /// For each property, where in a vertex's row it goes.
    pub(super) slots: Vec<Option<usize>>,
    /// How to read many items at once from a binary file, where they are simple enough.
    pub(super) block: Option<Block>,
}

pub(super) enum Content {
    Vertices(Box<Channels>),
    Corners {
        /// Number of the list property.
        list: usize,
        topology: Topology,
    },
    Skipped,
}

/// Vertices are numbered with 32 bits.
const MAX_VERTICES: u64 = 1 << 32;

impl Body {
    /// `last_line` is that of `end_header`, for messages.
    pub(super) fn new(elements: Vec<Element>, last_line: u64) -> Result<Self, ImportError> {
        let Some(vertex) = elements.iter().find(|element| element.name == "vertex") else {
            let names: Vec<_> = elements.iter().map(|element| element.name.as_str()).collect();
            let found =
                if names.is_empty() { "none".to_owned() } else { format!("`{}`", shown(names.join(" ").as_bytes())) };
            return Err(ImportError::malformed("an element `vertex`", found, Place::line(last_line)));
        };
        let vertex_count = vertex.count;
        if vertex_count >= MAX_VERTICES {
            let place = Place::line(vertex.line);
            return Err(ImportError::malformed("fewer than 4294967296 vertices", vertex_count.to_string(), place));
        }
        let mut body =
            Self { sections: Vec::new(), attributes: Attributes::default(), vertex_count, face_count: Some(0) };
        for element in elements {
            let section = Section::new(element, vertex_count)?;
            match (&section.content, section.element.name.as_str()) {
                (Content::Vertices(channels), _) => body.attributes = channels.attributes(),
                (_, "face") => body.face_count = body.face_count.map(|_| section.element.count),
                (_, "tristrips") => body.face_count = None,
                _ => {}
            }
            body.sections.push(section);
        }
        Ok(body)
    }
}

impl Section {
    fn new(element: Element, vertex_count: u64) -> Result<Self, ImportError> {
        let content = match element.name.as_str() {
            "vertex" => Content::Vertices(Box::new(Channels::of(&element)?)),
            "face" => Content::corners(&element, Topology::Fan)?,
            "tristrips" => Content::corners(&element, Topology::Strip)?,
            _ => Content::Skipped,
        };
        let slots = match &content {
            Content::Vertices(channels) => channels.slots(element.properties.len()),
            _ => vec![None; element.properties.len()],
        };
        let block = Block::of(&element, &content, vertex_count);
        Ok(Self { element, content, slots, block })
    }
}

impl Content {
    /// # Errors
    /// There are items, but no list of corners: better no model than one without its surface.
    fn corners(element: &Element, topology: Topology) -> Result<Self, ImportError> {
        let is_corners = |property: &Property| {
            matches!(property.shape, Shape::List { .. })
                && matches!(property.name.as_str(), "vertex_indices" | "vertex_index")
        };
        match element.properties.iter().position(is_corners) {
            Some(list) => Ok(Self::Corners { list, topology }),
            None if element.count == 0 => Ok(Self::Skipped),
            None => Err(ImportError::malformed(
                format!("a list `vertex_indices` or `vertex_index` in the element `{}`", element.name),
                element.property_names(),
                Place::line(element.line),
            )),
        }
    }
}
