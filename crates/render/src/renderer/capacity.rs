//! How much can be drawn within the budget.
//!
//! Goes in: a picture's size. Comes out: splats, or bytes of pages. What always holds: a frame of no more than that is not refused for
//! the budget, unless it has thousands of nodes or instances.

use super::Renderer;
use crate::buffers::Buffers;
use crate::gbuffer::GBuffer;
use crate::hybrid::arena;
use crate::hybrid::keyed::HybridBuffers;
use crate::splats::Kernel;
use crate::splats::keyed::{self, Bands};
use crate::splats::params::STRIDE;
use crate::splats::store;
use crate::staging::Staging;
use crate::targets::Targets;
use crate::{GpuLevel, Look};
use gigalod_format::hybrid::NodeRecord;
use gigalod_geom::ImageSize;

/// Parts that [`Renderer::most_splats`] leaves room for.
const USUAL_PARTS: u64 = 256;

impl Renderer {
    /// How many splats can be drawn into a picture of this size within the budget, and read back. 0 where there is no room for
    /// the picture itself.
    pub fn most_splats(&self, size: ImageSize, look: &Look) -> u64 {
        const NAMES: u64 = u32::MAX as u64 - 1;
        let Some(budget) = self.budget else { return NAMES };
        let room = budget.saturating_sub(self.bytes_without_primitives(size, look));
        // Whole rows of textures, and the smallest slices; the list has room for one slice.
        let listed = if self.gpu.level() > GpuLevel::WebGl { store::WIDTH * keyed::LISTED_BYTES } else { 0 };
        let row = store::ROW_BYTES + (STRIDE * store::WIDTH).div_ceil(keyed::LEAST_IN_SLICE);
        let in_list = keyed::MOST_IN_SLICE / store::WIDTH;
        let rows = match room / (row + listed) {
            rows if rows <= in_list => rows,
            _ => (room - in_list * listed) / row,
        };
        (rows * store::WIDTH).min(NAMES)
    }

    /// How a picture is cut up: what is kept for each of its pixels shall fit into a binding, and leave room for splats.
    pub(super) fn bands(&self, size: ImageSize, kernel: Kernel) -> Bands {
        const LEAST_BYTES: u64 = 1 << 20;
        let share = self.budget.map_or(u64::MAX, |budget| (budget / 8).max(LEAST_BYTES));
        Bands::new(size, kernel, self.gpu.most_buffer_bytes().min(share))
    }

    /// Bytes of hybrid pages that can be drawn into a picture of this size within the budget, and read back; [`Renderer::page_bytes`]
    /// says what a node's page takes. 0 where there is no room for the picture itself.
    pub fn most_page_bytes(&self, size: ImageSize, look: &Look) -> u64 {
        let most = arena::most_bytes(&self.gpu);
        let Some(budget) = self.budget else { return most };
        // Splats that blend have no use for what their keys have become.
        let [found, _] =
            if look.kernel.is_gauss() { self.bands(size, Kernel::Round).bytes(Kernel::Round) } else { [0; 2] };
        let taken = self.bytes_without_primitives(size, look)
            + GBuffer::before_bytes(size, true)
            + found
            + HybridBuffers::usual_bytes(&self.gpu);
        // Whole rows of a texture.
        (budget.saturating_sub(taken) / arena::ROW_BYTES * arena::ROW_BYTES).min(most)
    }

    /// How many triangles, points and lines that is, of usual models: half as many vertices as triangles.
    pub fn most_primitives(&self, size: ImageSize, look: &Look) -> u64 {
        const USUAL_BYTES: u64 = 16;
        self.most_page_bytes(size, look) / USUAL_BYTES
    }

    /// Bytes that the page of a hybrid node takes on the device.
    pub fn page_bytes(record: &NodeRecord) -> u64 {
        arena::page_bytes(record)
    }

    /// What a frame without a splat or a node takes.
    fn bytes_without_primitives(&self, size: ImageSize, look: &Look) -> u64 {
        let mut buffers = Buffers::new();
        let bands = self.bands(size, look.kernel);
        if self.gpu.level() > GpuLevel::WebGl {
            buffers.keyed.want(&bands, look.kernel, 0);
        }
        buffers.want_parts(STRIDE * USUAL_PARTS, USUAL_PARTS);
        buffers.want_readback(size);
        Staging::BYTES + Targets::bytes(size, look.samples, false) + buffers.least_bytes()
    }
}
