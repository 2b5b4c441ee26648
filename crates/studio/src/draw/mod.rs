//! Meshes drawn into textures of our own, which are then copied to the window.
//!
//! egui's pass has no depth, neither in the window nor in tests. So a shape is drawn into a texture
//! with depth while egui prepares its frame, and a callback copies that texture texel by texel: on
//! a software device a filtered copy of a window costs more than the shape itself.

mod pipelines;
mod scene;

use std::collections::HashMap;
use std::sync::Arc;

use eframe::egui_wgpu::{CallbackResources, CallbackTrait, RenderState, ScreenDescriptor};
use egui::PaintCallbackInfo;
use glam::{DMat4, DVec3};

use crate::model::Side;
use crate::worker::{Drawn, Rgba};
use pipelines::Pipelines;
use scene::Scene;

/// What a shape shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Surface {
    /// Plain grey.
    Grey,
    /// Its pictures, or its colours where it has none.
    #[default]
    Picture,
    /// Colours of vertices that were laid over it.
    Colors,
    /// A checker by texture coordinates.
    Checker,
}

/// How a shape is drawn in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// From the mesh's space to the clip space.
    pub matrix: DMat4,
    /// Towards the light, in the mesh's space.
    pub light: DVec3,
    /// What it shows.
    pub surface: Surface,
    /// Whether the second picture is laid over the first.
    pub over: bool,
    /// Whether edges are drawn.
    pub wireframe: bool,
    /// Behind the shape, sRGB.
    pub background: [f32; 3],
}

/// The shapes of both sides on the device.
pub struct Shapes {
    pipelines: Pipelines,
    scenes: HashMap<Side, Scene>,
}

impl std::fmt::Debug for Shapes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shapes").field("scenes", &self.scenes.len()).finish_non_exhaustive()
    }
}

/// Makes the pipelines; once, before anything is drawn.
pub fn prepare(state: &RenderState) {
    let shapes = Shapes { pipelines: Pipelines::new(state), scenes: HashMap::new() };
    state.renderer.write().callback_resources.insert(shapes);
}

/// Changes what is on the device.
fn change(state: &RenderState, change: impl FnOnce(&mut Shapes)) {
    if let Some(shapes) = state.renderer.write().callback_resources.get_mut::<Shapes>() {
        change(shapes);
    }
}

/// Another shape on a side.
pub fn set_shape(state: &RenderState, side: Side, drawn: &Drawn) {
    change(state, |shapes| {
        let scene = Scene::new(state, &shapes.pipelines, drawn);
        shapes.scenes.insert(side, scene);
    });
}

/// The picture of a side, and what may be laid over it, in place of its own.
pub fn set_picture(state: &RenderState, side: Side, picture: &Arc<Rgba>, over: &Arc<Rgba>) {
    change(state, |shapes| {
        if let Some(scene) = shapes.scenes.get_mut(&side) {
            scene.set_picture(state, &shapes.pipelines, picture, over);
        }
    });
}

/// A side shows no transferred picture any more.
pub fn drop_picture(state: &RenderState, side: Side) {
    change(state, |shapes| {
        if let Some(scene) = shapes.scenes.get_mut(&side) {
            scene.drop_picture();
        }
    });
}

/// Colours of the vertices of a side.
pub fn set_colors(state: &RenderState, side: Side, colors: &[[u8; 4]]) {
    change(state, |shapes| {
        if let Some(scene) = shapes.scenes.get_mut(&side) {
            scene.set_colors(state, colors);
        }
    });
}

/// A shape in a rectangle of the window.
pub fn shape(side: Side, rect: egui::Rect, pixels: [u32; 2], view: View) -> egui::Shape {
    let callback = Callback { side, pixels, view };
    eframe::egui_wgpu::Callback::new_paint_callback(rect, callback).into()
}

struct Callback {
    side: Side,
    pixels: [u32; 2],
    view: View,
}

impl CallbackTrait for Callback {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        _screen: &ScreenDescriptor,
        encoder: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        if let Some(shapes) = resources.get_mut::<Shapes>()
            && let Some(scene) = shapes.scenes.get_mut(&self.side)
        {
            scene.draw(device, queue, encoder, &shapes.pipelines, self.pixels, &self.view);
        }
        Vec::new()
    }

    fn paint(&self, _: PaintCallbackInfo, pass: &mut wgpu::RenderPass<'static>, resources: &CallbackResources) {
        if let Some(shapes) = resources.get::<Shapes>()
            && let Some(scene) = shapes.scenes.get(&self.side)
        {
            scene.copy(pass, &shapes.pipelines);
        }
    }
}
