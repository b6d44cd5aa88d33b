//! Numbers of accessors, a range at a time: any component type, strides, sparse replacements, packed views.
//!
//! What always holds: an accessor is checked against its view before it is read; a range takes memory for its own bytes.

use super::buffers::{Buffers, item, missing};
use super::json;
use crate::ImportError;
use std::collections::HashMap;
use std::sync::Arc;

/// Most elements of an accessor without a view, all zeros but for sparse ones: no byte of the file stands for them.
const MOST_ZEROS: u64 = 1 << 24;

/// The document and its buffers.
pub(super) struct Data {
    pub(super) root: json::Root,
    pub(super) buffers: Buffers,
    /// Elements that sparse accessors replace, ascending.
    sparse: HashMap<usize, Arc<Vec<u32>>>,
    scratch: Vec<u8>,
}

/// How an accessor's elements lie in its view.
#[derive(Clone, Copy)]
struct Layout {
    view: Option<usize>,
    offset: u64,
    stride: u64,
    component: Component,
    components: usize,
    count: u64,
    is_normalized: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(number: u32) -> Option<Self> {
        Some(match number {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number in the first bytes; as a share of the type's largest, where `is_normalized`.
    fn decode(self, bytes: &[u8], is_normalized: bool) -> f64 {
        let two = || [bytes[0], bytes[1]];
        let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, full) = match self {
            Self::I8 => (f64::from(bytes[0] as i8), 127.0),
            Self::U8 => (f64::from(bytes[0]), 255.0),
            Self::I16 => (f64::from(i16::from_le_bytes(two())), 32767.0),
            Self::U16 => (f64::from(u16::from_le_bytes(two())), 65535.0),
            Self::U32 => (f64::from(u32::from_le_bytes(four())), 4_294_967_295.0),
            Self::F32 => return f64::from(f32::from_le_bytes(four())),
        };
        if is_normalized { (value / full).max(-1.0) } else { value }
    }
}

impl Layout {
    fn element_bytes(&self) -> usize {
        self.component.bytes() * self.components
    }
}

impl Data {
    pub(super) fn new(root: json::Root, buffers: Buffers) -> Self {
        Self { root, buffers, sparse: HashMap::new(), scratch: Vec::new() }
    }

    /// Number of elements of an accessor, which is checked: it has one of the numbers of components, and lies in its view.
    pub(super) fn check(&self, number: usize, components: &[usize]) -> Result<u64, ImportError> {
        let layout = self.layout(number)?;
        if components.contains(&layout.components) {
            return Ok(layout.count);
        }
        let expected = format!("elements of {components:?} numbers");
        Err(ImportError::malformed(expected, layout.components.to_string(), item("accessor", number)))
    }

    fn accessor(&self, number: usize) -> Result<&json::Accessor, ImportError> {
        self.root.accessors.get(number).ok_or_else(|| missing("accessor", number, self.root.accessors.len()))
    }

    fn layout(&self, number: usize) -> Result<Layout, ImportError> {
        let accessor = self.accessor(number)?;
        let malformed =
            |expected: String, found: String| ImportError::malformed(expected, found, item("accessor", number));
        let component = Component::of(accessor.component_type)
            .ok_or_else(|| malformed("a component type of glTF".to_owned(), accessor.component_type.to_string()))?;
        let components = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            shape => return Err(malformed("SCALAR or VEC2 to VEC4".to_owned(), crate::error::said(shape))),
        };
        let count = accessor.count;
        if count >= u64::from(u32::MAX) {
            return Err(malformed("fewer than 4294967295 elements".to_owned(), count.to_string()));
        }
        let element_bytes = (component.bytes() * components) as u64;
        let mut stride = element_bytes;
        match accessor.buffer_view {
            None if count > MOST_ZEROS => {
                return Err(malformed(format!("at most {MOST_ZEROS} elements without a view"), count.to_string()));
            }
            None => {}
            Some(view) => {
                let bytes = self.buffers.view_bytes(&self.root, view)?;
                stride = self.root.buffer_views[view].byte_stride.unwrap_or(element_bytes);
                if stride < element_bytes || stride > 1 << 16 {
                    return Err(malformed(format!("a stride of at least {element_bytes} bytes"), stride.to_string()));
                }
                let last = count.checked_sub(1).map_or(0, |before| before * stride + element_bytes);
                if accessor.byte_offset.checked_add(last).is_none_or(|end| end > bytes) {
                    let expected = format!("{count} elements within the {bytes} bytes of the view");
                    return Err(malformed(expected, "more".to_owned()));
                }
            }
        }
        Ok(Layout {
            view: accessor.buffer_view,
            offset: accessor.byte_offset,
            stride,
            component,
            components,
            count,
            is_normalized: accessor.normalized,
        })
    }

    /// Replaces `rows` by elements from `first` on, each filled up with zeros. The range is one that [`Self::check`] knows.
    pub(super) fn read(
        &mut self,
        number: usize,
        first: u64,
        count: usize,
        rows: &mut Vec<[f64; 4]>,
    ) -> Result<(), ImportError> {
        let layout = self.layout(number)?;
        rows.clear();
        rows.resize(count, [0.0; 4]);
        if count == 0 {
            return Ok(());
        }
        if let Some(view) = layout.view {
            let bytes = (count - 1) * layout.stride as usize + layout.element_bytes();
            self.scratch.resize(bytes, 0);
            let Self { root, buffers, scratch, .. } = self;
            buffers.read(root, view, layout.offset + first * layout.stride, scratch)?;
            for (row, element) in rows.iter_mut().zip(scratch.chunks(layout.stride as usize)) {
                decode(&layout, element, row);
            }
        }
        self.replace(number, &layout, first, rows)
    }

    /// Puts the sparse elements of a range in their places.
    fn replace(
        &mut self,
        number: usize,
        layout: &Layout,
        first: u64,
        rows: &mut [[f64; 4]],
    ) -> Result<(), ImportError> {
        if self.accessor(number)?.sparse.is_none() {
            return Ok(());
        }
        let places = self.sparse_places(number, layout.count)?;
        let from = places.partition_point(|&place| u64::from(place) < first);
        let to = places.partition_point(|&place| u64::from(place) < first + rows.len() as u64);
        let element_bytes = layout.element_bytes();
        let mut bytes = vec![0; (to - from) * element_bytes];
        let Self { root, buffers, .. } = self;
        let values = &root.accessors[number].sparse.as_ref().expect("it was found").values;
        let offset = values.byte_offset.saturating_add((from * element_bytes) as u64);
        buffers.read(root, values.buffer_view, offset, &mut bytes)?;
        for (&place, element) in places[from..to].iter().zip(bytes.chunks_exact(element_bytes)) {
            decode(layout, element, &mut rows[(u64::from(place) - first) as usize]);
        }
        Ok(())
    }

    fn sparse_places(&mut self, number: usize, count: u64) -> Result<Arc<Vec<u32>>, ImportError> {
        if let Some(places) = self.sparse.get(&number) {
            return Ok(places.clone());
        }
        let Self { root, buffers, .. } = self;
        let sparse = root.accessors[number].sparse.as_ref().expect("it was found");
        let malformed =
            |expected: &str, found: String| ImportError::malformed(expected, found, item("accessor", number));
        let component = match Component::of(sparse.indices.component_type) {
            Some(component @ (Component::U8 | Component::U16 | Component::U32)) => component,
            _ => {
                return Err(malformed(
                    "sparse indices of unsigned integers",
                    sparse.indices.component_type.to_string(),
                ));
            }
        };
        let bytes = sparse.count.saturating_mul(component.bytes() as u64);
        if sparse.count > count || bytes > buffers.view_bytes(root, sparse.indices.buffer_view)? {
            return Err(malformed("as many sparse indices as there are", sparse.count.to_string()));
        }
        let mut packed = vec![0; bytes as usize];
        buffers.read(root, sparse.indices.buffer_view, sparse.indices.byte_offset, &mut packed)?;
        let places: Vec<u32> =
            packed.chunks_exact(component.bytes()).map(|bytes| component.decode(bytes, false) as u32).collect();
        let ascends = places.is_sorted_by(|a, b| a < b);
        if !ascends || places.last().is_some_and(|&last| u64::from(last) >= count) {
            return Err(malformed(&format!("sparse indices that ascend, below {count}"), "others".to_owned()));
        }
        let places = Arc::new(places);
        self.sparse.insert(number, places.clone());
        Ok(places)
    }

    /// Replaces `indices` by those from `first` on. Each is below `vertex_count`.
    pub(super) fn read_indices(
        &mut self,
        number: usize,
        first: u64,
        count: usize,
        vertex_count: u64,
        indices: &mut Vec<u32>,
    ) -> Result<(), ImportError> {
        let layout = self.layout(number)?;
        let is_index = matches!(layout.component, Component::U8 | Component::U16 | Component::U32);
        if !is_index || layout.components != 1 {
            let found = format!("component type {}", self.accessor(number)?.component_type);
            return Err(ImportError::malformed("indices of unsigned integers", found, item("accessor", number)));
        }
        let mut rows = Vec::new();
        self.read(number, first, count, &mut rows)?;
        indices.clear();
        for (at, [index, ..]) in (first..).zip(rows) {
            if index >= vertex_count as f64 {
                let expected = format!("an index below {vertex_count} as element {at}");
                return Err(ImportError::malformed(expected, index.to_string(), item("accessor", number)));
            }
            indices.push(index as u32);
        }
        Ok(())
    }
}

fn decode(layout: &Layout, element: &[u8], row: &mut [f64; 4]) {
    let bytes = layout.component.bytes();
    for (value, component) in row.iter_mut().zip(element.chunks_exact(bytes)).take(layout.components) {
        *value = layout.component.decode(component, layout.is_normalized);
    }
}
