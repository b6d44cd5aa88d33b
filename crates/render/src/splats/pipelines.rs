//! The passes that draw splats through keys, compiled when they are first used.
//!
//! Goes in: a kernel and what a frame needs of it. Comes out: pipelines, and the layouts of what they bind. What always holds: each
//! variant is compiled once; all variants of a pass bind the same things.
//!
//! What differs between variants is known before a frame and constant in all its invocations. It could be asked of a uniform, but the
//! software adapter goes through both sides of a branch.

use crate::Gpu;
use crate::gbuffer;
use crate::shader::{self, Target};
use crate::splats::params::{PartParams, PassParams};
use crate::splats::{BLEND, COMPUTE, Kernel, QUADS, RESOLVE, store};
use std::collections::BTreeMap;

/// Which splats a run of the compute pass draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Round {
    /// All.
    Whole,
    /// A few of all, from everywhere.
    First,
    /// Those that [`Round::First`] left, where they are nearer than what it found; with keys of 64 bits.
    Rest,
}

/// What resolving has to tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Resolving {
    /// Chunks hold splats of several instances.
    pub(crate) is_shared: bool,
    /// Extents of splats are wanted too.
    pub(crate) footprint: bool,
}

/// The passes of a kernel.
#[derive(Debug)]
pub(crate) struct Pipelines {
    kernel: Kernel,
    pub(crate) target: Target,
    compute: BTreeMap<Round, wgpu::ComputePipeline>,
    pub(crate) quads: wgpu::RenderPipeline,
    resolve: BTreeMap<Resolving, wgpu::RenderPipeline>,
    /// Of the three passes, in this order.
    pub(crate) layouts: [wgpu::BindGroupLayout; 3],
}

/// Where drawing with a kernel delivers to.
pub(crate) fn target(gpu: &Gpu, kernel: Kernel) -> Target {
    match (kernel.is_gauss(), gpu.has_wide_keys()) {
        (true, _) => Target::Sums,
        (false, true) => Target::Keys64,
        (false, false) => Target::Keys32,
    }
}

/// A truth value, as constants of pipelines are given.
fn set(value: bool) -> f64 {
    f64::from(u8::from(value))
}

fn options<'a>(constants: &'a [(&'a str, f64)]) -> wgpu::PipelineCompilationOptions<'a> {
    wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: true }
}

fn pipeline_layout(gpu: &Gpu, layout: &wgpu::BindGroupLayout) -> wgpu::PipelineLayout {
    gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    })
}

impl Pipelines {
    /// What all frames with this kernel need.
    pub(crate) fn new(gpu: &Gpu, kernel: Kernel) -> Self {
        let target = target(gpu, kernel);
        let layouts = layouts(gpu, kernel, target);
        let module = shader::module(&gpu.device, "splat_quads.wgsl", QUADS, target);
        let constants = drawing(gpu, kernel, target);
        let quads = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("large splats"),
            layout: Some(&pipeline_layout(gpu, &layouts[1])),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("place"),
                compilation_options: options(&constants),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::TriangleStrip, ..Default::default() },
            depth_stencil: Some(gbuffer::depth_state(wgpu::CompareFunction::Always, false)),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("cover"),
                compilation_options: options(&constants),
                targets: &[],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { kernel, target, compute: BTreeMap::new(), quads, resolve: BTreeMap::new(), layouts }
    }

    /// Compiles what a frame needs and what no earlier one needed.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, rounds: &[Round], resolving: Resolving) {
        for round in rounds {
            if !self.compute.contains_key(round) {
                self.compute.insert(*round, self.compile_compute(gpu, *round));
            }
        }
        if !self.resolve.contains_key(&resolving) {
            self.resolve.insert(resolving, self.compile_resolve(gpu, resolving));
        }
    }

    /// Small splats; prepared.
    pub(crate) fn compute(&self, round: Round) -> &wgpu::ComputePipeline {
        &self.compute[&round]
    }

    /// Keys or sums to G-buffer; prepared.
    pub(crate) fn resolve(&self, resolving: Resolving) -> &wgpu::RenderPipeline {
        &self.resolve[&resolving]
    }

    fn compile_compute(&self, gpu: &Gpu, round: Round) -> wgpu::ComputePipeline {
        let target = match round {
            Round::Rest => Target::Keys64Found,
            Round::Whole | Round::First => self.target,
        };
        let mut constants = drawing(gpu, self.kernel, self.target);
        constants.push(("round", f64::from(round as u8)));
        gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("small splats"),
            layout: Some(&pipeline_layout(gpu, &self.layouts[0])),
            module: &shader::module(&gpu.device, "splat_compute.wgsl", COMPUTE, target),
            entry_point: Some("draw_small"),
            compilation_options: options(&constants),
            cache: None,
        })
    }

    fn compile_resolve(&self, gpu: &Gpu, resolving: Resolving) -> wgpu::RenderPipeline {
        let mut constants = vec![("kernel", self.kernel.code())];
        let (name, source) = if self.kernel.is_gauss() {
            ("splat_blend.wgsl", BLEND)
        } else {
            // A pass may be given only what it declares.
            constants.push(("is_shared", set(resolving.is_shared)));
            constants.push(("wants_footprint", set(resolving.footprint)));
            ("splat_resolve.wgsl", RESOLVE)
        };
        let module = shader::module(&gpu.device, name, source, Target::None);
        gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("resolved splats"),
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

/// Constants of the passes that draw.
fn drawing(gpu: &Gpu, kernel: Kernel, target: Target) -> Vec<(&'static str, f64)> {
    let mut constants = vec![("kernel", kernel.code())];
    if target == Target::Keys64 {
        constants.push(("reads_first", set(!gpu.is_software())));
    }
    constants
}

/// Bindings that all passes have: uniforms at dynamic offsets, with their sizes.
const UNIFORMS: [(u32, u64); 2] = [(0, size_of::<PassParams>() as u64), (1, size_of::<PartParams>() as u64)];

/// Of the three passes: number of each binding, stages, whether it is written.
fn layouts(gpu: &Gpu, kernel: Kernel, target: Target) -> [wgpu::BindGroupLayout; 3] {
    let device = &gpu.device;
    let gauss = kernel.is_gauss();
    let (both, vertex, fragment, compute) = (
        wgpu::ShaderStages::VERTEX_FRAGMENT,
        wgpu::ShaderStages::VERTEX,
        wgpu::ShaderStages::FRAGMENT,
        wgpu::ShaderStages::COMPUTE,
    );
    let read = |binding, stages| (binding, stages, true);
    let write = |binding, stages| (binding, stages, false);
    let with_sums = |mut entries: Vec<_>, entry| {
        if gauss {
            entries.push(entry);
        }
        entries
    };
    let layout = |label, uniforms: usize, stages, textures: &[u32], storage: &[(u32, wgpu::ShaderStages, bool)]| {
        let buffer = |binding, visibility, ty, has_dynamic_offset, bytes| wgpu::BindGroupLayoutEntry {
            binding,
            visibility,
            ty: wgpu::BindingType::Buffer {
                ty,
                has_dynamic_offset,
                min_binding_size: std::num::NonZeroU64::new(bytes),
            },
            count: None,
        };
        let uniforms = UNIFORMS[..uniforms]
            .iter()
            .map(|(binding, bytes)| buffer(*binding, stages, wgpu::BufferBindingType::Uniform, true, *bytes));
        let storage = storage.iter().map(|(binding, stages, read_only)| {
            buffer(*binding, *stages, wgpu::BufferBindingType::Storage { read_only: *read_only }, false, 0)
        });
        let textures = textures.iter().map(|binding| store::layout_entry(*binding, stages));
        let entries: Vec<_> = uniforms.chain(storage).chain(textures).collect();
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
    };
    let for_compute = [write(4, compute), write(6, compute), write(7, compute)];
    let seen_by_compute: &[u32] = if target == Target::Keys64 { &[2, 3, 9] } else { &[2, 3] };
    let for_quads = [write(4, fragment), read(6, vertex), read(8, vertex)];
    let for_resolve: (&[_], &[_]) =
        if gauss { (&[], &[read(4, fragment), read(5, fragment)]) } else { (&[2, 3, 9], &[read(8, fragment)]) };
    [
        layout("small splats", 2, compute, seen_by_compute, &with_sums(for_compute.to_vec(), write(5, compute))),
        layout("large splats", 1, both, &[2, 3], &with_sums(for_quads.to_vec(), write(5, fragment))),
        layout("resolved splats", if gauss { 1 } else { 2 }, fragment, for_resolve.0, for_resolve.1),
    ]
}
