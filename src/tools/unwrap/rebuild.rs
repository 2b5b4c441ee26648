//! A mesh as the atlas crate takes it, and with the texture coordinates that it gives.

use glam::{DVec2, DVec3};
use uvunwrap::{Atlas, Density, MeshInput, Options, Packing};

use super::UnwrapOptions;
use super::cuts::Cuts;
use crate::error::{Error, Result};
use crate::geometry::{Corner, Frame, Mesh, MeshBuilder, NONE};

/// More triangles than this are packed by rows, which is tens of times faster with thousands of
/// charts.
const SHAPES: usize = 400_000;
/// Triangles of mean size that a chart may grow to: the time to flatten one grows faster than its
/// size.
const LARGEST_CHART: f64 = 20_000.0;

/// The mesh in single precision, in a unit box around its middle.
pub(super) struct Input {
    positions: Vec<[f32; 3]>,
    indices: Vec<u32>,
    /// Texture coordinates to keep, by vertex; none to make them.
    texcoords: Option<Vec<[f32; 2]>>,
    polygons: Vec<u32>,
    materials: Vec<u32>,
    /// Of the surface, in these positions' units.
    area: f64,
}

impl Input {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let frame = Frame::of_mesh(mesh);
        let (low, high) = mesh.bounds().unwrap_or_default();
        let size = (high - low).max_element();
        // Coordinates of unused vertices may be anything.
        let place = |p: &DVec3| {
            let q = (*p - frame.origin) / size;
            if q.is_finite() { q.as_vec3().to_array() } else { [0.0; 3] }
        };
        Self {
            positions: mesh.positions.iter().map(place).collect(),
            indices: mesh.triangles().into_iter().flatten().collect(),
            texcoords: None,
            polygons: (0..mesh.triangle_count()).map(|t| mesh.triangle_polygon(t)).collect(),
            materials: (0..mesh.triangle_count()).map(|t| mesh.triangle_material(t)).collect(),
            area: mesh.area() / (size * size),
        }
    }

    /// The same mesh with the charts of `atlas`, to be cut and packed again.
    pub(super) fn keep(&mut self, atlas: &Atlas) {
        let output = &atlas.meshes[0];
        self.positions = output.vertices.iter().map(|v| self.positions[v.xref as usize]).collect();
        self.indices.clone_from(&output.indices);
        let cropped = atlas.height as f32 / atlas.width as f32;
        self.texcoords = Some(output.vertices.iter().map(|v| [v.uv[0], v.uv[1] * cropped]).collect());
    }

    /// The charts under these cuts.
    pub(super) fn atlas(&self, cuts: &Cuts, options: &UnwrapOptions, name: &str) -> Result<Atlas> {
        // A polygon that is cut is its triangles, each a polygon with a number of its own.
        let own = self.polygons.iter().copied().max().unwrap_or(0) + 1;
        let mut loose = vec![false; own as usize];
        for (t, _) in cuts.loose.iter().enumerate().filter(|(_, l)| **l) {
            loose[self.polygons[t] as usize] = true;
        }
        let polygon = |(t, &p): (usize, &u32)| if loose[p as usize] { own + t as u32 } else { p };
        let polygons: Vec<u32> = self.polygons.iter().enumerate().map(polygon).collect();
        let input = MeshInput {
            face_materials: Some(&self.materials),
            seams: Some(&cuts.seams),
            polygons: Some(&polygons),
            existing_uvs: self.texcoords.as_deref(),
            ..MeshInput::new(&self.positions, &self.indices)
        };
        let share = LARGEST_CHART / self.polygons.len() as f64;
        let largest = if share < 1.0 { (share * self.area) as f32 } else { 0.0 };
        let options = Options {
            max_chart_area: if largest.is_finite() { largest } else { 0.0 },
            max_chart_angle: options.angle as f32,
            density: Density::Auto { page_size: options.size },
            padding: options.gap.div_ceil(2),
            packing: if self.polygons.len() > SHAPES { Packing::Fast } else { Packing::Shape },
            ..Options::default()
        };
        let few = "Raise --size or lower --margin: each chart needs some texels and its margin";
        let atlas = uvunwrap::generate(&[input], &options).map_err(|error| match error {
            uvunwrap::Error::ChartTooLarge { .. } | uvunwrap::Error::AtlasTooLarge { .. } => {
                Error::mesh(name, format!("its charts do not fit the texture ({error})"), few)
            }
            other => Error::mesh(name, format!("it cannot be unwrapped ({other})"), "Check and repair the mesh"),
        })?;
        if atlas.page_count > 1 {
            let what = format!("its {} charts do not fit a texture of {} texels", atlas.chart_count, atlas.width);
            return Err(Error::mesh(name, what, few));
        }
        Ok(atlas)
    }
}

/// The texture coordinates of `atlas`, and which of them each corner of each triangle has.
pub(super) fn texcoords(atlas: &Atlas) -> (Vec<DVec2>, &[u32]) {
    let output = &atlas.meshes[0];
    // The page is cut off above what is used; the texture is square. Rounded, so that files in
    // single precision hold the same.
    let cropped = f64::from(atlas.height) / f64::from(atlas.width);
    let place = |uv: [f32; 2]| DVec2::new(f64::from(uv[0]), f64::from((f64::from(uv[1]) * cropped) as f32));
    (output.vertices.iter().map(|v| place(v.uv)).collect(), &output.indices)
}

/// `mesh` with texture coordinates, of which each corner of each triangle has one, and how many of
/// its polygons had to be cut into triangles. The triangles keep their order.
pub(super) fn with_texcoords(mesh: &Mesh, (texcoords, of_corner): (Vec<DVec2>, &[u32])) -> (Mesh, usize) {
    let mut builder = MeshBuilder::like(mesh);
    builder.mesh.positions.clone_from(&mesh.positions);
    builder.mesh.normals.clone_from(&mesh.normals);
    builder.mesh.colors.clone_from(&mesh.colors);
    builder.mesh.texcoords = texcoords;
    let mut cut = 0;
    let mut t = 0;
    for p in 0..mesh.polygon_count() {
        builder.follow(mesh, p);
        let corners: Vec<Corner> = mesh.file_polygon(p).collect();
        let count = corners.len().saturating_sub(2);
        let mut own = vec![NONE; corners.len()];
        let mut whole = true;
        for k in t..t + count {
            for (c, place) in mesh.triangle_places(k).into_iter().enumerate() {
                let texcoord = of_corner[3 * k + c];
                whole &= own[place] == NONE || own[place] == texcoord;
                own[place] = texcoord;
            }
        }
        if whole {
            builder.polygon(corners.iter().zip(&own).map(|(c, &texcoord)| Corner { texcoord, ..*c }));
        } else {
            cut += 1;
            for k in t..t + count {
                let places = mesh.triangle_places(k).into_iter().enumerate();
                builder.polygon(places.map(|(c, place)| Corner { texcoord: of_corner[3 * k + c], ..corners[place] }));
            }
        }
        t += count;
    }
    let mut made = builder.finish();
    made.join_as(mesh);
    (made, cut)
}
