//! How many pixels a list covers: what drawing it costs besides the number of triangles and points.

use super::HybridList;
use super::look::Look;
use crate::ModelView;
use crate::splats::Cutting;

impl HybridList {
    /// Sum of the rectangles around nodes, as far as they lie in the picture, in pixels; an estimate: a node's surface fills its
    /// rectangle about once.
    pub fn area_px(&self, view: &ModelView) -> f64 {
        let Some(file) = &self.hybrid else { return 0.0 };
        let size = view.size();
        let look = Look::new(view, file.skeleton(), Cutting::default());
        let nodes = self.nodes.iter().filter_map(|node| file.skeleton().nodes().get(node.node.0 as usize));
        nodes.map(|record| look.area_px(record, f64::from(size.width), f64::from(size.height))).sum()
    }
}
