//! One shape on the device, and the texture that it is drawn into.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use eframe::egui_wgpu::RenderState;
use glam::DMat4;
use wgpu::util::DeviceExt;

use super::pipelines::{COLOR, DEPTH, Pipelines};
use super::{Surface, View};
use crate::worker::{Drawn, Part, Rgba, Soup};

/// What pulls lines towards the eye, in parts of the depth.
const PULL: f32 = 2e-4;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Frame {
    matrix: [[f32; 4]; 4],
    light: [f32; 4],
    kind: [u32; 4],
    color: [f32; 4],
}

/// A shape.
pub(super) struct Scene {
    soup: Arc<Soup>,
    corners: wgpu::Buffer,
    colors: wgpu::Buffer,
    edges: wgpu::Buffer,
    frame: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    /// For each picture of the shape, and one for parts without.
    groups: Vec<wgpu::BindGroup>,
    /// The transferred picture, which all parts show.
    given: Option<Given>,
    /// Whether its own look is colours of vertices.
    by_color: bool,
    screen: Option<Screen>,
    /// What is on the screen, so that the same is not drawn again.
    drawn: Option<View>,
}

struct Given {
    picture: wgpu::Texture,
    over: wgpu::Texture,
    group: wgpu::BindGroup,
}

struct Screen {
    size: [u32; 2],
    color: wgpu::TextureView,
    /// With several samples a pixel, where these are.
    samples: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
    copied: wgpu::BindGroup,
}

impl Scene {
    pub(super) fn new(state: &RenderState, pipelines: &Pipelines, drawn: &Drawn) -> Self {
        let (device, soup) = (&state.device, drawn.soup.clone());
        let buffer = |contents: &[u8], usage| {
            // A buffer of no bytes cannot be bound.
            let contents = if contents.is_empty() { &[0; 16] } else { contents };
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage })
        };
        let vertex = wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST;
        let colors = spread(&soup, drawn.colors.as_deref().unwrap_or(&[]));
        let frame = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size: SIZE,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let binding = wgpu::BufferBinding { buffer: &frame, offset: 0, size: wgpu::BufferSize::new(SIZE) };
        let frame_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipelines.frame,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::Buffer(binding) }],
        });
        let blank = Rgba { width: 1, height: 1, bytes: vec![0; 4] };
        let none = texture(state, &blank);
        let mut groups: Vec<_> =
            drawn.pictures.iter().map(|p| group(state, pipelines, &texture(state, p), &none)).collect();
        groups.push(group(state, pipelines, &none, &none));
        Self {
            corners: buffer(bytemuck::cast_slice(&soup.corners), vertex),
            colors: buffer(bytemuck::cast_slice(&colors), vertex),
            edges: buffer(bytemuck::cast_slice(&soup.edges), wgpu::BufferUsages::INDEX),
            by_color: drawn.colors.is_some(),
            soup,
            frame,
            frame_group,
            groups,
            given: None,
            screen: None,
            drawn: None,
        }
    }

    pub(super) fn set_picture(&mut self, state: &RenderState, pipelines: &Pipelines, picture: &Rgba, over: &Rgba) {
        self.drawn = None;
        if let Some(given) = &self.given
            && [given.picture.width(), given.picture.height()] == [picture.width, picture.height]
        {
            write(state, &given.picture, picture);
            write(state, &given.over, over);
            return;
        }
        let (picture, over) = (texture(state, picture), texture(state, over));
        let group = group(state, pipelines, &picture, &over);
        self.given = Some(Given { picture, over, group });
    }

    pub(super) fn drop_picture(&mut self) {
        (self.given, self.drawn) = (None, None);
    }

    pub(super) fn set_colors(&mut self, state: &RenderState, colors: &[[u8; 4]]) {
        self.drawn = None;
        let colors = spread(&self.soup, colors);
        if !colors.is_empty() {
            state.queue.write_buffer(&self.colors, 0, bytemuck::cast_slice(&colors));
        }
    }

    /// Draws the shape into its texture, unless it is there already.
    pub(super) fn draw(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        pipelines: &Pipelines,
        size: [u32; 2],
        view: &View,
    ) {
        if self.screen.as_ref().is_none_or(|s| s.size != size) {
            self.screen = Some(Screen::new(device, pipelines, size));
            self.drawn = None;
        }
        if self.drawn.as_ref() == Some(view) {
            return;
        }
        self.drawn = Some(*view);
        let Some(screen) = &self.screen else { return };
        let matrix = view.matrix * DMat4::from_translation(self.soup.centre);
        let kind = match view.surface {
            Surface::Grey => 0,
            Surface::Picture if self.given.is_some() => 1,
            Surface::Picture if self.by_color => 2,
            Surface::Picture => 1,
            Surface::Colors => 2,
            Surface::Checker => 3,
        };
        let over = u32::from(view.over && self.given.is_some());
        let light = view.light.as_vec3().extend(PULL).to_array();
        let columns = matrix.as_mat4().to_cols_array_2d();
        let frame = Frame { matrix: columns, light, kind: [kind, over, 0, 0], color: [0.1, 0.1, 0.12, 1.0] };
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let [r, g, b] = view.background.map(f64::from);
        let clear = wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 });
        let (target, resolve) = match &screen.samples {
            Some(samples) => (samples, Some(&screen.color)),
            None => (&screen.color, None),
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shape"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: resolve,
                ops: wgpu::Operations { load: clear, store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &screen.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_bind_group(0, &self.frame_group, &[]);
        pass.set_vertex_buffer(0, self.corners.slice(..));
        pass.set_vertex_buffer(1, self.colors.slice(..));
        pass.set_pipeline(&pipelines.surface);
        for Part { corners, picture } in &self.soup.parts {
            let own = picture.unwrap_or(self.groups.len() - 1).min(self.groups.len() - 1);
            let group = self.given.as_ref().map_or(&self.groups[own], |g| &g.group);
            pass.set_bind_group(1, group, &[]);
            pass.draw(corners.clone(), 0..1);
        }
        if view.wireframe {
            pass.set_pipeline(&pipelines.lines);
            pass.set_index_buffer(self.edges.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..self.soup.edges.len() as u32, 0, 0..1);
        }
    }

    /// Copies the texture to the window.
    pub(super) fn copy(&self, pass: &mut wgpu::RenderPass<'static>, pipelines: &Pipelines) {
        let Some(screen) = &self.screen else { return };
        pass.set_pipeline(&pipelines.blit);
        pass.set_bind_group(0, &screen.copied, &[]);
        pass.draw(0..3, 0..1);
    }
}

const SIZE: u64 = size_of::<Frame>() as u64;

impl Screen {
    fn new(device: &wgpu::Device, pipelines: &Pipelines, size: [u32; 2]) -> Self {
        let most = device.limits().max_texture_dimension_2d;
        let [width, height] = size.map(|s| s.clamp(1, most));
        let make = |format, sample_count, usage| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some("viewport"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            });
            texture.create_view(&Default::default())
        };
        let color = make(COLOR, 1, wgpu::TextureUsages::TEXTURE_BINDING);
        let several = pipelines.samples > 1;
        let samples = several.then(|| make(COLOR, pipelines.samples, wgpu::TextureUsages::empty()));
        let depth = make(DEPTH, pipelines.samples, wgpu::TextureUsages::empty());
        let copied = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipelines.copied,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&color) }],
        });
        Self { size, color, samples, depth, copied }
    }
}

/// Colours of corners; grey where there are none.
fn spread(soup: &Soup, colors: &[[u8; 4]]) -> Vec<[u8; 4]> {
    soup.vertices.iter().map(|&v| colors.get(v as usize).copied().unwrap_or([160, 160, 165, 255])).collect()
}

fn texture(state: &RenderState, picture: &Rgba) -> wgpu::Texture {
    let texture = state.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width: picture.width, height: picture.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: COLOR,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    write(state, &texture, picture);
    texture
}

fn write(state: &RenderState, texture: &wgpu::Texture, picture: &Rgba) {
    state.queue.write_texture(
        texture.as_image_copy(),
        &picture.bytes,
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * picture.width), rows_per_image: None },
        texture.size(),
    );
}

fn group(state: &RenderState, pipelines: &Pipelines, picture: &wgpu::Texture, over: &wgpu::Texture) -> wgpu::BindGroup {
    let (picture, over) = (picture.create_view(&Default::default()), over.create_view(&Default::default()));
    state.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipelines.pictures,
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&picture) },
            wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&pipelines.sampler) },
            wgpu::BindGroupEntry { binding: 2, resource: wgpu::BindingResource::TextureView(&over) },
        ],
    })
}
