//! Pipelines and layouts, made once.

use eframe::egui_wgpu::RenderState;

use crate::worker::Corner;

/// Format of the textures that shapes are drawn into: values as they are stored.
pub(super) const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Format of their depth.
pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Everything that does not depend on shapes.
pub(super) struct Pipelines {
    pub(super) surface: wgpu::RenderPipeline,
    pub(super) lines: wgpu::RenderPipeline,
    pub(super) blit: wgpu::RenderPipeline,
    pub(super) frame: wgpu::BindGroupLayout,
    pub(super) pictures: wgpu::BindGroupLayout,
    pub(super) copied: wgpu::BindGroupLayout,
    pub(super) sampler: wgpu::Sampler,
    /// Samples of a pixel: several where the device is no software.
    pub(super) samples: u32,
}

impl Pipelines {
    pub(super) fn new(state: &RenderState) -> Self {
        let device = &state.device;
        let software = state.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
        let samples = if software { 1 } else { 4 };
        let uniform = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let texture = |filterable| wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let layout = |label, entries: &[wgpu::BindingType]| {
            let entry = |(k, ty): (usize, &wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
                binding: k as u32,
                visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                ty: *ty,
                count: None,
            };
            let entries: Vec<_> = entries.iter().enumerate().map(entry).collect();
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
        };
        let sampling = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let frame = layout("frame", &[uniform]);
        let pictures = layout("pictures", &[texture(true), sampling, texture(true)]);
        let copied = layout("copied", &[texture(false)]);
        let mesh = device.create_shader_module(wgpu::include_wgsl!("mesh.wgsl"));
        let copy = device.create_shader_module(wgpu::include_wgsl!("blit.wgsl"));
        let on = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let corners = wgpu::VertexBufferLayout {
            array_stride: size_of::<Corner>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x2],
        };
        let colors = wgpu::VertexBufferLayout {
            array_stride: 4,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![3 => Unorm8x4],
        };
        let drawn = |vertex, fragment, topology, groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(vertex),
                layout: Some(&on(groups)),
                vertex: wgpu::VertexState {
                    module: &mesh,
                    entry_point: Some(vertex),
                    compilation_options: Default::default(),
                    buffers: &[Some(corners.clone()), Some(colors.clone())],
                },
                primitive: wgpu::PrimitiveState { topology, ..Default::default() },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::LessEqual),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: wgpu::MultisampleState { count: samples, ..Default::default() },
                fragment: Some(wgpu::FragmentState {
                    module: &mesh,
                    entry_point: Some(fragment),
                    compilation_options: Default::default(),
                    targets: &[Some(COLOR.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let surface =
            drawn("corner", "surface", wgpu::PrimitiveTopology::TriangleList, &[Some(&frame), Some(&pictures)]);
        let lines = drawn("line", "ink", wgpu::PrimitiveTopology::LineList, &[Some(&frame)]);
        let linear = [("linear", f64::from(u8::from(state.target_format.is_srgb())))];
        let blit = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("copy to the window"),
            layout: Some(&on(&[Some(&copied)])),
            vertex: wgpu::VertexState {
                module: &copy,
                entry_point: Some("corner"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &copy,
                entry_point: Some("texel"),
                compilation_options: wgpu::PipelineCompilationOptions { constants: &linear, ..Default::default() },
                targets: &[Some(state.target_format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            address_mode_u: wgpu::AddressMode::Repeat,
            address_mode_v: wgpu::AddressMode::Repeat,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        Self { surface, lines, blit, frame, pictures, copied, sampler, samples }
    }
}
