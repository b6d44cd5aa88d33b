//! The passes that draw hybrid nodes, compiled when they are first used; all variants of a pass bind the same things.

use crate::Gpu;
use crate::gbuffer;
use crate::hybrid::params::HybridParams;
use crate::hybrid::plan::Kind;
use crate::hybrid::{LARGE, RESOLVE, SMALL};
use crate::shader::{self, Target};
use std::collections::BTreeMap;

/// What resolving has to tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Resolving {
    /// There is something besides triangles.
    pub(crate) has_spots: bool,
    /// Vertices have colours.
    pub(crate) has_colors: bool,
}

/// The passes.
#[derive(Debug)]
pub(crate) struct Pipelines {
    target: Target,
    small: BTreeMap<Kind, wgpu::ComputePipeline>,
    large: BTreeMap<Kind, wgpu::ComputePipeline>,
    resolve: BTreeMap<Resolving, wgpu::RenderPipeline>,
    /// Of the three passes, in this order.
    pub(crate) layouts: [wgpu::BindGroupLayout; 3],
}

fn options<'a>(constants: &'a [(&'a str, f64)]) -> wgpu::PipelineCompilationOptions<'a> {
    wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: true }
}

impl Pipelines {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let target = if gpu.has_wide_keys() { Target::Keys64 } else { Target::Keys32 };
        Self {
            target,
            small: BTreeMap::new(),
            large: BTreeMap::new(),
            resolve: BTreeMap::new(),
            layouts: layouts(&gpu.device),
        }
    }

    /// Keys of 32 bits find depth and number one after the other.
    pub(crate) fn phases(&self) -> u32 {
        if self.target == Target::Keys64 { 1 } else { 2 }
    }

    /// Compiles what a frame needs, once.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, kinds: impl Iterator<Item = Kind>, resolving: Resolving) {
        for kind in kinds {
            if !self.small.contains_key(&kind) {
                let small = self.compile(gpu, kind, ("hybrid_small.wgsl", SMALL, "draw_small"), &self.layouts[0]);
                let large = self.compile(gpu, kind, ("hybrid_large.wgsl", LARGE, "draw_large"), &self.layouts[1]);
                self.small.insert(kind, small);
                self.large.insert(kind, large);
            }
        }
        if !self.resolve.contains_key(&resolving) {
            self.resolve.insert(resolving, self.compile_resolve(gpu, resolving));
        }
    }

    /// Small ones of a kind; prepared.
    pub(crate) fn small(&self, kind: Kind) -> &wgpu::ComputePipeline {
        &self.small[&kind]
    }

    /// Large ones of a kind; prepared.
    pub(crate) fn large(&self, kind: Kind) -> &wgpu::ComputePipeline {
        &self.large[&kind]
    }

    /// Keys to G-buffer; prepared.
    pub(crate) fn resolve(&self, resolving: Resolving) -> &wgpu::RenderPipeline {
        &self.resolve[&resolving]
    }

    fn compile(
        &self,
        gpu: &Gpu,
        kind: Kind,
        (name, source, entry_point): (&str, &str, &str),
        layout: &wgpu::BindGroupLayout,
    ) -> wgpu::ComputePipeline {
        let mut constants = vec![("kind", f64::from(kind as u8))];
        if self.target == Target::Keys64 {
            // As for splats: on the software adapter a read costs more than it saves.
            constants.push(("reads_first", f64::from(u8::from(!gpu.is_software()))));
        }
        gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: Some(&pipeline_layout(gpu, layout)),
            module: &shader::module(&gpu.device, name, source, self.target),
            entry_point: Some(entry_point),
            compilation_options: options(&constants),
            cache: None,
        })
    }

    fn compile_resolve(&self, gpu: &Gpu, resolving: Resolving) -> wgpu::RenderPipeline {
        let module = shader::module(&gpu.device, "hybrid_resolve.wgsl", RESOLVE, Target::None);
        let set = |value: bool| f64::from(u8::from(value));
        let constants = [("has_spots", set(resolving.has_spots)), ("has_colors", set(resolving.has_colors))];
        gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("resolved nodes"),
            layout: Some(&pipeline_layout(gpu, &self.layouts[2])),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("cover_picture"),
                compilation_options: options(&constants),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: Some(gbuffer::depth_state(wgpu::CompareFunction::GreaterEqual, true)),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("resolve"),
                compilation_options: options(&constants),
                targets: &gbuffer::COLOR_TARGETS,
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

fn pipeline_layout(gpu: &Gpu, layout: &wgpu::BindGroupLayout) -> wgpu::PipelineLayout {
    gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    })
}

/// Of the three passes: parameters, tables, and what each reads or writes besides.
fn layouts(device: &wgpu::Device) -> [wgpu::BindGroupLayout; 3] {
    let layout = |label, visibility, textures: &[u32], storage: &[(u32, bool)]| {
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
        let buffer = |ty, has_dynamic_offset, bytes| wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset,
            min_binding_size: std::num::NonZeroU64::new(bytes),
        };
        let texture = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Uint,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let uniform = buffer(wgpu::BufferBindingType::Uniform, true, size_of::<HybridParams>() as u64);
        let mut entries = vec![entry(0, uniform)];
        entries.extend(textures.iter().map(|binding| entry(*binding, texture)));
        entries.extend(storage.iter().map(|(binding, read_only)| {
            entry(*binding, buffer(wgpu::BufferBindingType::Storage { read_only: *read_only }, false, 0))
        }));
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
    };
    let compute = wgpu::ShaderStages::COMPUTE;
    [
        layout("small primitives", compute, &[1, 2, 3, 9], &[(4, false), (6, false), (7, false)]),
        layout("large primitives", compute, &[1, 2, 3, 9], &[(4, false), (6, true), (7, true)]),
        layout("resolved nodes", wgpu::ShaderStages::FRAGMENT, &[1, 2, 3, 9], &[]),
    ]
}
