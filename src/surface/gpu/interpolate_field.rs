//! Host half of the kernel `interpolate_field`, and fields on a device.

use super::map::{DeviceMap, HostMap, MapTables, device, obstacle};
use super::project_phong::ProjectParams;
use super::tables::{SurfaceTables, append_rows};
use super::tile::{Points, Projection, Work, capacity};
use crate::engine::{BindingKind, Engine, Gpu, Kernel, Table};
use crate::error::{Error, Result};
use crate::surface::correspondence::Vouching;
use crate::surface::field::Field;
use crate::surface::packed::{PackedImage, PackedPoint};
use crate::surface::project;

pub(super) static INTERPOLATE_FIELD: Kernel = variant(&[("RECORDS", 0.0)]);
/// The same of records.
static INTERPOLATE_RECORDS: Kernel = variant(&[("RECORDS", 1.0)]);

const fn variant(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "interpolate_field",
        source: include_str!("../../../shaders/interpolate_field.wgsl"),
        bindings: &[BindingKind::Read, BindingKind::Write, BindingKind::Table, BindingKind::Table],
        layouts: &[],
        items: 1,
        constants,
    }
}

/// A field and the source on a device.
#[derive(Debug)]
struct FieldTables {
    source: SurfaceTables,
    starts: Table,
    triangles: Table,
    field: Table,
}

impl MapTables for FieldTables {
    fn capacity(&self, gpu: &Gpu) -> usize {
        capacity(gpu, size_of::<[f32; 12]>(), 1)
    }

    fn of_field(&self) -> Option<[&Table; 2]> {
        Some([&self.field, &self.starts])
    }

    fn work(&self, gpu: &Gpu, capacity: usize, points: &Points<'_>) -> Result<Work> {
        let images = gpu.buffer::<[f32; 12]>("images", capacity)?;
        let pipeline = gpu.pipeline(if points.are_records() { &INTERPOLATE_RECORDS } else { &INTERPOLATE_FIELD })?;
        let group = gpu.bind(&pipeline, &[points.bind(), images.bind(), self.triangles.bind(), self.field.bind()])?;
        let forward = ProjectParams::new::<12>(gpu.capabilities(), &self.source, 1, [0, 0])?;
        let forward = Projection::new::<12, _>(gpu, capacity, forward, &images, points, &self.source, &self.starts)?;
        Ok(Work { images: vec![(pipeline, group)], forward, back: None, _kept: Box::new(images) })
    }
}

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

    fn vouching(&self) -> Vouching {
        self.vouching()
    }

    fn drift_of(&self, face: u32) -> [f64; 3] {
        self.drift_of(face)
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
    /// [`Error::Input`] if there is an obstacle ([`Self::obstacle`]);
    /// [`Error::Memory`](crate::Error::Memory), [`Error::Capability`](crate::Error::Capability) or
    /// [`Error::Device`](crate::Error::Device) if it does not fit.
    pub fn new(engine: &Engine, map: Field<f32, 12>) -> Result<Self> {
        let gpu = device(engine, INTERPOLATE_FIELD.name)?;
        let source = SurfaceTables::new(gpu, "source", map.source())?;
        let starts: Vec<[u32; 4]> = (0..map.triangles().len() as u32).map(|t| map.starts_of(t)).collect();
        let starts = gpu.table("starts", &starts)?;
        let triangles: Vec<[u32; 4]> = map.triangles().iter().map(|&[a, b, c]| [a, b, c, 0]).collect();
        let triangles = gpu.table("triangles", &triangles)?;
        let mut field = Vec::new();
        append_rows(map.images(), &mut field);
        let field = gpu.table("field", &field)?;
        Self::of(engine, gpu, map, Box::new(FieldTables { source, starts, triangles, field }))
    }

    /// Takes over the images of `field`, which differs from this one in those of `triangles` alone,
    /// as after [`FieldSession::edit`](crate::surface::field::FieldSession::edit). Only what has
    /// changed goes up: 48 bytes a vertex and 16 a triangle, and what lies between two that are
    /// near one another in the tables.
    ///
    /// # Errors
    /// [`Error::Input`] if the field is not of the same meshes;
    /// [`Error::Device`] if the device fails.
    pub fn follow(&mut self, field: &Field<f32, 12>, triangles: &[u32]) -> Result<()> {
        let gpu = device(self.engine(), INTERPOLATE_FIELD.name)?;
        let same = field.triangles() == self.reference().triangles();
        if !same || triangles.iter().any(|t| *t as usize >= field.triangles().len()) {
            return Err(Error::input("a map is to follow a field of other meshes", "Put that field on the device"));
        }
        if let Some([images, starts]) = self.tables().of_field() {
            let mut vertices: Vec<u32> = triangles.iter().flat_map(|&t| field.triangles()[t as usize]).collect();
            vertices.sort_unstable();
            for range in ranges(&vertices) {
                let mut rows = Vec::new();
                append_rows(&field.images()[range.clone()], &mut rows);
                gpu.write_table(images, 3 * range.start, &rows)?;
            }
            let mut sorted = triangles.to_vec();
            sorted.sort_unstable();
            for range in ranges(&sorted) {
                let rows: Vec<[u32; 4]> = range.clone().map(|t| field.starts_of(t as u32)).collect();
                gpu.write_table(starts, range.start, &rows)?;
            }
        }
        self.reference_mut().follow(field);
        Ok(())
    }
}

/// Records this far apart go up in one piece.
const NEAR: u32 = 32;

/// Ranges with all of some numbers, which rise.
fn ranges(numbers: &[u32]) -> Vec<std::ops::Range<usize>> {
    let mut ranges: Vec<std::ops::Range<usize>> = Vec::new();
    for &n in numbers {
        match ranges.last_mut().filter(|r| n as usize <= r.end + NEAR as usize) {
            Some(range) => range.end = range.end.max(n as usize + 1),
            None => ranges.push(n as usize..n as usize + 1),
        }
    }
    ranges
}
