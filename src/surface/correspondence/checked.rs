//! Triangles that a map turns over: whatever the method, nothing vouches for points in them.

use glam::DVec3;

use super::{PointMap, Shape};
use crate::engine::{Binding, Buffer, Gpu};
use crate::error::{Error, Result};
use crate::geometry::{Frame, SurfacePoint};
use crate::surface::field::FieldReport;
use crate::surface::packed::{Doubts, MapStage, PackedImage, PackedPoint, ResidentMap, Status};
use crate::surface::quality::{flipped, normal_at, vertex_normals};

/// Confidence of what is doubtful for another reason than its own evidence, at most: well below
/// what counts as valid.
pub(crate) const DOUBT: f32 = 0.25;

/// A map whose turned triangles are known: their points, corners included, are doubtful at best.
pub(super) struct Checked {
    map: Box<dyn PointMap + Send>,
    /// Of the target.
    triangles: Vec<[u32; 3]>,
    /// Whether a triangle of the target is turned over.
    turned: Vec<bool>,
    /// Whether a vertex of the target is a corner of one that is.
    touched: Vec<bool>,
    /// Points that were handed back before anything was asked for.
    begun: Option<u64>,
}

/// The images of the vertices of usable triangles, each as a corner of its lowest one.
pub(super) fn vertex_images(map: &dyn PointMap, shape: &Shape<'_>) -> Result<Vec<PackedImage>> {
    let vertices: Vec<(u32, SurfacePoint)> =
        (0..shape.mesh.vertex_count() as u32).filter_map(|v| shape.topology.vertex_point(v).map(|p| (v, p))).collect();
    let points: Vec<PackedPoint> = vertices.iter().map(|&(_, p)| p.into()).collect();
    let mut found = Vec::new();
    map.map(&points, &mut found)?;
    let mut images = vec![PackedImage::NOWHERE; shape.mesh.vertex_count()];
    vertices.iter().zip(found).for_each(|(&(v, _), image)| images[v as usize] = image);
    Ok(images)
}

impl Checked {
    /// Maps all vertices of the target once.
    pub(super) fn new(map: Box<dyn PointMap + Send>, source: Shape<'_>, target: Shape<'_>) -> Result<Self> {
        let images: Vec<Option<SurfacePoint>> =
            vertex_images(map.as_ref(), &target)?.into_iter().map(PackedImage::point).collect();
        let of_source = vertex_normals(source.mesh, source.topology);
        let frame = Frame::of_mesh(source.mesh);
        let positions: Vec<Option<DVec3>> = images.iter().map(|p| p.map(|p| frame.place(&p, source.mesh))).collect();
        let normals: Vec<DVec3> =
            images.iter().map(|p| p.map_or(DVec3::ZERO, |p| normal_at(source.mesh, &of_source, &p))).collect();
        let triangles = target.topology.triangles.clone();
        let mut turned = vec![false; triangles.len()];
        let mut touched = vec![false; target.mesh.vertex_count()];
        for t in flipped(target.mesh, target.topology, &positions, &normals) {
            turned[t as usize] = true;
            triangles[t as usize].iter().for_each(|&v| touched[v as usize] = true);
        }
        let begun = map.handed_back();
        Ok(Self { map, triangles, turned, touched, begun })
    }

    /// Whether a turned triangle holds the point.
    fn doubts(&self, p: &PackedPoint) -> bool {
        let t = p.face as usize;
        let x = [p.b0, p.b1, 1.0 - p.b0 - p.b1];
        let corner = x.iter().position(|&x| x == 1.0);
        self.turned[t] || corner.is_some_and(|k| self.touched[self.triangles[t][k] as usize])
    }
}

impl Checked {
    /// Takes the trust from points in turned triangles.
    fn doubt(&self, points: &[PackedPoint], images: &mut [PackedImage]) {
        for (_, image) in points.iter().zip(images).filter(|(p, _)| self.doubts(p)) {
            image.confidence = image.confidence.min(DOUBT);
            image.status = image.status.min(Status::Doubtful as u32);
        }
    }

    /// The map within, of whose residence [`PointMap::resident`] has made sure.
    fn within(&self) -> Result<&dyn ResidentMap> {
        self.map.resident().ok_or_else(|| Error::input("the map works on the CPU", "Use --backend cpu"))
    }
}

impl ResidentMap for Checked {
    fn gpu(&self) -> Option<&Gpu> {
        self.map.resident().and_then(ResidentMap::gpu)
    }

    fn bind(&self, points: Binding<'_>, images: &Buffer<PackedImage>, doubts: Doubts<'_>) -> Result<Box<dyn MapStage>> {
        let of = |t: u32| {
            let corner = |k: usize| self.touched[self.triangles[t as usize][k] as usize];
            let bits = |set: bool, k: u32| if set { Doubts::TURNED << k } else { 0 };
            let own = bits(self.turned[t as usize], 0);
            (0..3).fold(own | doubts.0(t), |all, k| all | bits(corner(k), k as u32 + 1))
        };
        self.within()?.bind(points, images, Doubts(&of))
    }

    fn finish(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        self.within()?.finish(points, images)?;
        self.doubt(points, images);
        Ok(())
    }
}

impl PointMap for Checked {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        self.map.map(points, images)?;
        self.doubt(points, images);
        Ok(())
    }

    fn resident(&self) -> Option<&dyn ResidentMap> {
        self.map.resident().map(|_| self as &dyn ResidentMap)
    }

    fn handed_back(&self) -> Option<u64> {
        self.map.handed_back().map(|n| n - self.begun.unwrap_or(0))
    }

    fn field(&self) -> Option<&FieldReport> {
        self.map.field()
    }
}
