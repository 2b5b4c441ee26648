//! Host half of the kernel `interpolate_field`, and fields on a device.

use super::map::{DeviceMap, HostMap, device, obstacle};
use super::project_phong::ProjectParams;
use super::tables::{SurfaceTables, append_rows};
use super::tile::{Projection, Tile, capacity};
use crate::engine::{BindingKind, Engine, Kernel};
use crate::error::Result;
use crate::surface::field::Field;
use crate::surface::packed::{PackedImage, PackedPoint};
use crate::surface::project;

pub(super) static INTERPOLATE_FIELD: Kernel = Kernel {
    name: "interpolate_field",
    source: include_str!("../../../shaders/interpolate_field.wgsl"),
    bindings: &[BindingKind::Read, BindingKind::Write, BindingKind::Table, BindingKind::Table],
    layouts: &[],
    items: 1,
    constants: &[],
};

impl HostMap for Field<f32, 12> {
    fn face_count(&self) -> usize {
        self.triangles().len()
    }

    fn judge(
        &self,
        point: PackedPoint,
        image: &project::Projection<f32>,
        _round_trip: Option<f64>,
    ) -> Option<PackedImage> {
        self.stays_near(image).then(|| self.judged(point, image))
    }
}

impl DeviceMap<Field<f32, 12>> {
    /// Why the kernels cannot do this work on `engine`; `None` if they can.
    pub fn obstacle(engine: &Engine, dimension: usize) -> Option<String> {
        obstacle(engine, INTERPOLATE_FIELD.name, dimension)
    }

    /// Puts a field on the device of `engine`. What its guard looks at closer goes through the
    /// reference.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) if there is an obstacle ([`Self::obstacle`]);
    /// [`Error::Memory`](crate::Error::Memory), [`Error::Capability`](crate::Error::Capability) or
    /// [`Error::Device`](crate::Error::Device) if it does not fit.
    pub fn new(engine: &Engine, map: Field<f32, 12>) -> Result<Self> {
        const BYTES: usize = size_of::<[f32; 12]>();
        let gpu = device(engine, INTERPOLATE_FIELD.name)?;
        let source = SurfaceTables::new(gpu, "source", map.source())?;
        let starts: Vec<[u32; 4]> = (0..map.triangles().len() as u32).map(|t| map.starts_of(t)).collect();
        let starts = gpu.table("starts", &starts)?;
        let triangles: Vec<[u32; 4]> = map.triangles().iter().map(|&[a, b, c]| [a, b, c, 0]).collect();
        let triangles = gpu.table("triangles", &triangles)?;
        let mut field = Vec::new();
        append_rows(map.images(), &mut field);
        let field = gpu.table("field", &field)?;

        let capacity = capacity(gpu, BYTES, 1);
        let points = gpu.buffer::<PackedPoint>("points", capacity)?;
        let images = gpu.buffer::<[f32; 12]>("images", capacity)?;
        let pipeline = gpu.pipeline(&INTERPOLATE_FIELD)?;
        let group = gpu.bind(&pipeline, &[points.bind(), images.bind(), triangles.bind(), field.bind()])?;
        let forward = ProjectParams::new::<12>(gpu.capabilities(), &source, 1, [0, 0])?;
        let forward = Projection::new::<12, _>(gpu, capacity, forward, &images, &points, &source, &starts)?;
        let tile = Tile::new(capacity, points, vec![(pipeline, group)], forward, None);
        Ok(Self::of(engine, map, tile, Box::new((source, starts, triangles, field, images))))
    }
}
