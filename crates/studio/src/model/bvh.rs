//! Which point of a mesh a ray meets first.

use barymap::geometry::{Mesh, SurfacePoint};
use glam::DVec3;

use super::camera::Ray;

/// Triangles in a leaf at most.
const LEAF: usize = 4;
/// Levels below the root at most: halves of 2^32 triangles.
const DEPTH: usize = 40;

/// Boxes within boxes around the triangles of a mesh.
#[derive(Clone, Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Triangles in the order of the leaves, and their corners.
    order: Vec<u32>,
    corners: Vec<[DVec3; 3]>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The first of two children if `count` is 0, else the first of so many triangles.
    first: u32,
    count: u32,
}

/// Where a ray meets a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The point of the mesh.
    pub point: SurfacePoint,
    /// How far along the ray.
    pub distance: f64,
}

impl Bvh {
    /// Of all triangles that have an area. O(F log F).
    pub fn new(mesh: &Mesh) -> Self {
        let all: Vec<[DVec3; 3]> = (0..mesh.triangle_count()).map(|t| mesh.triangle_positions(t)).collect();
        let sound = |t: &u32| {
            let [a, b, c] = all[*t as usize];
            let normal = (b - a).cross(c - a);
            normal.is_finite() && normal != DVec3::ZERO
        };
        let mut order: Vec<u32> = (0..all.len() as u32).filter(sound).collect();
        let mut bvh = Self { nodes: Vec::new(), order: Vec::new(), corners: Vec::new() };
        if !order.is_empty() {
            bvh.nodes.push(Node { low: DVec3::ZERO, high: DVec3::ZERO, first: 0, count: 0 });
            let count = order.len();
            bvh.split(0, &mut order, 0..count, &all);
        }
        bvh.corners = order.iter().map(|&t| all[t as usize]).collect();
        bvh.order = order;
        bvh
    }

    fn split(&mut self, node: usize, order: &mut [u32], range: std::ops::Range<usize>, all: &[[DVec3; 3]]) {
        let part = &mut order[range.clone()];
        let corners = part.iter().flat_map(|&t| all[t as usize]);
        let (low, high) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        if part.len() <= LEAF {
            self.nodes[node] = Node { low, high, first: range.start as u32, count: part.len() as u32 };
            return;
        }
        let size = high - low;
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
        let middle = part.len() / 2;
        let centre = |t: &u32| all[*t as usize].iter().map(|p| p[axis]).sum::<f64>();
        part.select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)).then(a.cmp(b)));
        let first = self.nodes.len();
        self.nodes[node] = Node { low, high, first: first as u32, count: 0 };
        let blank = Node { low, high, first: 0, count: 0 };
        self.nodes.extend([blank, blank]);
        self.split(first, order, range.start..range.start + middle, all);
        self.split(first + 1, order, range.start + middle..range.end, all);
    }

    /// The first point of the mesh that a ray meets, from either side. O(log F) for usual meshes.
    pub fn hit(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let inverse = ray.direction.recip();
        let mut stack = Vec::with_capacity(DEPTH);
        if !self.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(i) = stack.pop() {
            let node = &self.nodes[i];
            let limit = best.map_or(f64::INFINITY, |b| b.distance);
            let (a, b) = ((node.low - ray.origin) * inverse, (node.high - ray.origin) * inverse);
            // A ray within a face of the box gives NaN, which `f64::min` and `f64::max` pass over.
            let enter = (0..3).fold(0.0, |e: f64, k| e.max(a[k].min(b[k])));
            let leave = (0..3).fold(limit, |l: f64, k| l.min(a[k].max(b[k])));
            if enter > leave {
                continue;
            }
            let first = node.first as usize;
            if node.count == 0 {
                stack.extend([first, first + 1]);
                continue;
            }
            for k in first..first + node.count as usize {
                if let Some((distance, barycentric)) = meet(ray, &self.corners[k])
                    && best.is_none_or(|b| distance < b.distance)
                {
                    best = Some(Hit { point: SurfacePoint::new(self.order[k], barycentric), distance });
                }
            }
        }
        best
    }

    /// Whether nothing lies between `eye` and the surface at `p`, but for `slack`.
    pub fn is_visible(&self, eye: DVec3, p: DVec3, slack: f64) -> bool {
        let distance = eye.distance(p);
        let ray = Ray { origin: eye, direction: (p - eye) / distance };
        self.hit(&ray).is_none_or(|hit| hit.distance > distance - slack)
    }
}

/// Distance and barycentric coordinates of the place where a ray meets a triangle (Moller and
/// Trumbore 1997).
fn meet(ray: &Ray, [a, b, c]: &[DVec3; 3]) -> Option<(f64, [f64; 3])> {
    let (e, f) = (*b - *a, *c - *a);
    let p = ray.direction.cross(f);
    let determinant = e.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = ray.origin - *a;
    let u = s.dot(p) / determinant;
    let q = s.cross(e);
    let v = ray.direction.dot(q) / determinant;
    let distance = f.dot(q) / determinant;
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0;
    inside.then_some((distance, [1.0 - u - v, u, v]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::camera::Camera;
    use barymap::models::shapes::{Diagonal, Random, lobed_sphere, plane_grid};
    use glam::DVec2;

    #[test]
    fn boxes_find_what_all_triangles_find() {
        let mesh = lobed_sphere(3, 0.3);
        let bvh = Bvh::new(&mesh);
        let mut camera = Camera::default();
        camera.frame(mesh.bounds().unwrap(), 1.0);
        let mut random = Random::new(3);
        let mut hits = 0;
        for _ in 0..500 {
            camera.orbit(DVec2::new(random.signed(), 0.2 * random.signed()));
            let ray = camera.ray(DVec2::new(random.signed(), random.signed()), 1.0);
            let all = (0..mesh.triangle_count())
                .filter_map(|t| meet(&ray, &mesh.triangle_positions(t)).map(|m| m.0))
                .fold(f64::INFINITY, f64::min);
            match bvh.hit(&ray) {
                None => assert_eq!(all, f64::INFINITY),
                Some(hit) => {
                    hits += 1;
                    assert_eq!(hit.distance, all);
                    let there = ray.origin + hit.distance * ray.direction;
                    assert!(hit.point.position(&mesh).distance(there) < 1e-9);
                    assert!(hit.point.is_valid(&mesh, 0.0));
                }
            }
        }
        assert!((100..450).contains(&hits), "{hits}");
    }

    #[test]
    fn the_far_side_is_hidden() {
        let mesh = lobed_sphere(3, 0.0);
        let bvh = Bvh::new(&mesh);
        let eye = DVec3::new(0.1, 0.2, 5.0);
        let near = bvh.hit(&Ray { origin: eye, direction: DVec3::NEG_Z }).unwrap().point.position(&mesh);
        assert!(bvh.is_visible(eye, near, 1e-6));
        assert!(!bvh.is_visible(eye, -near, 1e-6));
    }

    #[test]
    fn a_mesh_without_triangles_or_area_is_met_nowhere() {
        let flat = Mesh::from_triangles("flat", vec![DVec3::ZERO; 3], &[[0, 1, 2]]).unwrap();
        let ray = Ray { origin: DVec3::Z, direction: DVec3::NEG_Z };
        for mesh in [Mesh::default(), flat] {
            assert!(Bvh::new(&mesh).hit(&ray).is_none());
        }
        // A ray in the plane of the boxes, which are flat.
        let plane = plane_grid(4, 4, 1.0, 1.0, Diagonal::Forward);
        assert!(Bvh::new(&plane).hit(&Ray { origin: DVec3::new(0.3, 0.3, 1.0), direction: DVec3::NEG_Z }).is_some());
    }
}
