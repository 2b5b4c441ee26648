//! How good a correspondence is: stretch, flips, distance to a known truth.

use glam::DVec3;

use crate::geometry::{Mesh, SurfacePoint, Topology};

/// Distortion of a map given by the images of the target's vertices, measured per triangle of the
/// target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distortion {
    /// Symmetrised L2 stretch efficiency over all mapped triangles, 1/sym: 1 for an isometry, 0 if
    /// a triangle collapses.
    pub stretch_all: f64,
    /// The same over the best 95 % of the area.
    pub stretch_best95: f64,
    /// Triangles whose image is turned over.
    pub flipped_faces: usize,
    /// Their share of the mapped target area.
    pub flipped_area: f64,
    /// Triangles all of whose vertices were mapped.
    pub mapped_faces: usize,
}

/// Distortion of the map that takes vertex `v` of `target` to `images[v]` in space, on a source
/// with outward normals `normals[v]` at the images.
///
/// With both surfaces scaled to equal area and singular values `G >= g` of a triangle's affine map,
/// the stretch is `ab = mean of (G^2 + g^2)/2` weighted with target areas, `ba = mean of (1/G^2 +
/// 1/g^2)/2` weighted with image areas, and the efficiency is `1/sym`, `sym = (ab + ba)/2` (the
/// reading of Schreiner et al. 2004 that all our figures use; the published normalisation could not
/// be verified). A triangle is flipped if its image's normal opposes the mean of the source's
/// normals there; mirrored maps are recognised by the majority of area. O(F log F).
pub fn distortion(
    target: &Mesh,
    topology: &Topology,
    images: &[Option<DVec3>],
    normals: &[DVec3],
    source_area: f64,
) -> Distortion {
    struct Measured {
        area: f64,
        image_area: f64,
        forward: f64,
        backward: f64,
        flipped: bool,
    }
    let over = flipped(target, topology, images, normals);
    let unit_target = 1.0 / target.area().sqrt();
    let unit_source = 1.0 / source_area.sqrt();
    let mut list: Vec<Measured> = Vec::new();
    for t in (0..target.triangle_count()).filter(|&t| topology.usable[t]) {
        let v = target.triangle(t).map(|v| v as usize);
        let (Some(a), Some(b), Some(c)) = (images[v[0]], images[v[1]], images[v[2]]) else { continue };
        // Differences first: far from the origin scaled coordinates would round once more.
        let p = target.triangle_positions(t);
        let (e1, e2) = ((p[1] - p[0]) * unit_target, (p[2] - p[0]) * unit_target);
        let (f1, f2) = ((b - a) * unit_source, (c - a) * unit_source);
        let double_area = e1.cross(e2).length();
        let image_normal = f1.cross(f2);
        // Gram matrices: the trace of C^-1 C' is G^2 + g^2, their determinants' ratio (Gg)^2.
        let (e11, e12, e22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
        let (f11, f12, f22) = (f1.dot(f1), f1.dot(f2), f2.dot(f2));
        let trace = (e22 * f11 - 2.0 * e12 * f12 + e11 * f22) / (double_area * double_area);
        let ratio = image_normal.length() / double_area;
        let backward = if ratio > 0.0 { 0.5 * trace / (ratio * ratio) } else { f64::INFINITY };
        list.push(Measured {
            area: 0.5 * double_area,
            image_area: 0.5 * image_normal.length(),
            forward: 0.5 * trace,
            backward,
            flipped: over.binary_search(&(t as u32)).is_ok(),
        });
    }
    let mapped: f64 = list.iter().map(|m| m.area).sum();
    if list.is_empty() || mapped <= 0.0 {
        return Distortion {
            stretch_all: 0.0,
            stretch_best95: 0.0,
            flipped_faces: 0,
            flipped_area: 0.0,
            mapped_faces: 0,
        };
    }
    let flipped_area: f64 = list.iter().filter(|m| m.flipped).map(|m| m.area).sum();
    let efficiency = |part: &[Measured]| {
        let area: f64 = part.iter().map(|m| m.area).sum();
        let image: f64 = part.iter().map(|m| m.image_area).sum();
        let ab = part.iter().map(|m| m.area * m.forward).sum::<f64>() / area;
        let ba = part
            .iter()
            .map(|m| if m.image_area > 0.0 { m.image_area * m.backward } else { f64::INFINITY })
            .sum::<f64>()
            / image;
        let sym = 0.5 * (ab + ba);
        if sym.is_finite() { 1.0 / sym } else { 0.0 }
    };
    list.sort_by(|a, b| (a.forward + a.backward).total_cmp(&(b.forward + b.backward)));
    let mut kept = 0;
    let mut sum = 0.0;
    while kept < list.len() && sum + list[kept].area <= 0.95 * mapped {
        sum += list[kept].area;
        kept += 1;
    }
    Distortion {
        stretch_all: efficiency(&list),
        stretch_best95: if kept > 0 { efficiency(&list[..kept]) } else { 0.0 },
        flipped_faces: over.len(),
        // An empty sum is -0.
        flipped_area: flipped_area / mapped + 0.0,
        mapped_faces: list.len(),
    }
}

/// The triangles that the map of [`distortion`] turns over, rising: those whose image faces against
/// the source there, or the others where that is most of the area. O(F).
pub fn flipped(target: &Mesh, topology: &Topology, images: &[Option<DVec3>], normals: &[DVec3]) -> Vec<u32> {
    let (mut turned, mut straight) = (Vec::new(), Vec::new());
    let (mut over, mut all) = (0.0, 0.0);
    for t in (0..target.triangle_count()).filter(|&t| topology.usable[t]) {
        let v = target.triangle(t).map(|v| v as usize);
        let [Some(a), Some(b), Some(c)] = v.map(|v| images[v]) else { continue };
        let area = target.triangle_area(t);
        all += area;
        if turns([a, b, c], v.map(|v| normals[v])) {
            over += area;
            turned.push(t as u32);
        } else {
            straight.push(t as u32);
        }
    }
    if over > 0.5 * all { straight } else { turned }
}

/// Whether a triangle faces against the mean of the normals at its corners.
fn turns([a, b, c]: [DVec3; 3], normals: [DVec3; 3]) -> bool {
    (b - a).cross(c - a).dot(normals[0] + normals[1] + normals[2]) < 0.0
}

/// Area-weighted unit normals of the vertices; zero for vertices of no usable triangle.
pub fn vertex_normals(mesh: &Mesh, topology: &Topology) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; mesh.vertex_count()];
    for t in (0..mesh.triangle_count()).filter(|&t| topology.usable[t]) {
        let n = mesh.triangle_area_normal(t);
        for v in mesh.triangle(t) {
            normals[v as usize] += n;
        }
    }
    normals.iter().map(|n| n.normalize_or_zero()).collect()
}

/// The interpolated normal of a surface point.
pub fn normal_at(mesh: &Mesh, normals: &[DVec3], p: &SurfacePoint) -> DVec3 {
    let v = mesh.triangle(p.face as usize);
    (0..3).map(|k| normals[v[k] as usize] * p.barycentric[k]).sum::<DVec3>().normalize_or_zero()
}

/// A summary of errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorSummary {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

/// Mean, median, 95th percentile and maximum of `errors`; zeros for none.
pub fn summarise(errors: &[f64]) -> ErrorSummary {
    if errors.is_empty() {
        return ErrorSummary { mean: 0.0, median: 0.0, p95: 0.0, max: 0.0 };
    }
    let mut sorted = errors.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |f: f64| sorted[((sorted.len() - 1) as f64 * f).round() as usize];
    ErrorSummary {
        mean: sorted.iter().sum::<f64>() / sorted.len() as f64,
        median: at(0.5),
        p95: at(0.95),
        max: sorted[sorted.len() - 1],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::uv_sphere;

    #[test]
    fn identity_is_perfect_and_mirrors_are_recognised() {
        let mesh = uv_sphere(1.0, 24, 12);
        let topology = Topology::new(&mesh);
        let normals = vertex_normals(&mesh, &topology);
        let same: Vec<_> = mesh.positions.iter().map(|&p| Some(p)).collect();
        let d = distortion(&mesh, &topology, &same, &normals, mesh.area());
        assert!((d.stretch_all - 1.0).abs() < 1e-9 && d.flipped_faces == 0, "{d:?}");
        let mirror = |p: DVec3| DVec3::new(-p.x, p.y, p.z);
        let images: Vec<_> = mesh.positions.iter().map(|&p| Some(mirror(p))).collect();
        let mirrored: Vec<_> = normals.iter().map(|&n| mirror(n)).collect();
        let d = distortion(&mesh, &topology, &images, &mirrored, mesh.area());
        assert_eq!(d.flipped_faces, 0, "{d:?}");
    }

    #[test]
    fn scale_does_not_count_but_anisotropy_does() {
        let mesh = uv_sphere(1.0, 24, 12);
        let topology = Topology::new(&mesh);
        let normals = vertex_normals(&mesh, &topology);
        let images: Vec<_> = mesh.positions.iter().map(|&p| Some(p * 3.0)).collect();
        let d = distortion(&mesh, &topology, &images, &normals, 9.0 * mesh.area());
        assert!((d.stretch_all - 1.0).abs() < 1e-9);
        let images: Vec<_> = mesh.positions.iter().map(|&p| Some(p * DVec3::new(1.0, 1.0, 2.0))).collect();
        assert!(distortion(&mesh, &topology, &images, &normals, 2.0 * mesh.area()).stretch_all < 0.9);
    }

    #[test]
    fn a_turned_triangle_is_found() {
        let mesh = crate::models::shapes::plane_grid(8, 8, 1.0, 1.0, crate::models::shapes::Diagonal::Forward);
        let topology = Topology::new(&mesh);
        let normals = vertex_normals(&mesh, &topology);
        let mut images: Vec<_> = mesh.positions.iter().map(|&p| Some(p)).collect();
        let v = (0..mesh.vertex_count()).find(|&v| !topology.one_ring(v as u32).boundary).unwrap();
        images[v] = Some(mesh.positions[v] + DVec3::new(0.2, 0.0, 0.0));
        assert!(distortion(&mesh, &topology, &images, &normals, mesh.area()).flipped_faces > 0);
    }
}
