//! The built-in characters: what the truth of every accuracy figure rests on.

use barymap::geometry::{Mesh, NONE, SurfacePoint, Topology};
use barymap::models::{Character, character_pair, stout, strider};
use barymap::picture::Image;
use glam::{DVec2, DVec3};

fn edge_count(mesh: &Mesh) -> usize {
    let sides = |t: [u32; 3]| [0, 1, 2].map(|k| (t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3])));
    let mut edges: Vec<_> = mesh.triangles().into_iter().flat_map(sides).collect();
    edges.sort_unstable();
    edges.dedup();
    edges.len()
}

#[test]
fn characters_are_closed_spheres_that_face_outwards() {
    for character in [strider(), stout()] {
        let mesh = &character.mesh;
        let t = Topology::new(mesh);
        assert!(t.usable.iter().all(|&u| u), "{}", mesh.name);
        let faults = (t.boundary_edges, t.nonmanifold_edges, t.misoriented_edges);
        assert_eq!((faults, t.component_count), ((0, 0, 0), 1), "{}", mesh.name);
        assert_eq!(mesh.vertex_count() + mesh.triangle_count(), edge_count(mesh) + 2, "{}", mesh.name);
        assert!((10_000..=20_000).contains(&mesh.triangle_count()), "{}", mesh.name);
        let volume = |[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)) / 6.0;
        let sum: f64 = (0..mesh.triangle_count()).map(|f| volume(mesh.triangle_positions(f))).sum();
        assert!(sum > 0.02, "{}: {sum}", mesh.name);
    }
}

/// Largest difference in parameters between target vertices and their places on the source.
fn parameter_error(source: &Character, target: &Character, truth: &[SurfacePoint]) -> f64 {
    (0..target.mesh.vertex_count())
        .map(|v| {
            let (p, q) = (target.vertex_parameter(v), source.parameter(&truth[v]));
            if p.quad == q.quad { (p.u - q.u).abs().max((p.v - q.v).abs()) } else { f64::INFINITY }
        })
        .fold(0.0, f64::max)
}

#[test]
fn truth_has_equal_parameters() {
    let pair = character_pair();
    assert!(pair.truth.iter().all(|p| p.is_valid(&pair.source.mesh, 0.0)));
    assert!(parameter_error(&pair.source, &pair.target, &pair.truth) < 1e-12);
    let mut wrong = pair.truth.clone();
    wrong.rotate_left(1);
    assert!(parameter_error(&pair.source, &pair.target, &wrong) > 0.1);
}

#[test]
fn truth_is_the_same_place_of_the_neutral_body() {
    // Two triangulations of one smooth body differ by the height of a chord, edge^2 / (8 * radius):
    // at the finger tips, with edges and a radius of 30 mm, that is 4 mm; on average it is far
    // less.
    let pair = character_pair();
    let place = |p: &SurfacePoint| -> DVec3 {
        let t = pair.source.mesh.triangle(p.face as usize);
        (0..3).map(|k| pair.source.neutral[t[k] as usize] * p.barycentric[k]).sum()
    };
    let gaps = |truth: &[SurfacePoint]| -> Vec<f64> {
        truth.iter().zip(&pair.target.neutral).map(|(p, x)| place(p).distance(*x)).collect()
    };
    let true_gaps = gaps(&pair.truth);
    let mean = true_gaps.iter().sum::<f64>() / true_gaps.len() as f64;
    let largest = true_gaps.into_iter().fold(0.0, f64::max);
    assert!(largest < 4e-3 && mean < 6e-4, "{largest} {mean}");
    let mut wrong = pair.truth.clone();
    wrong.swap(0, pair.truth.len() - 1);
    assert!(gaps(&wrong).into_iter().fold(0.0, f64::max) > 0.05);
}

#[test]
fn truth_there_and_back_returns() {
    let pair = character_pair();
    let back = pair.clone().reversed();
    for v in (0..pair.target.mesh.vertex_count()).step_by(7) {
        let there = pair.truth[v];
        let again = back.true_source(&there).position(&pair.target.mesh);
        assert!(again.distance(pair.target.mesh.positions[v]) < 1e-10, "vertex {v}");
    }
}

#[test]
fn the_characters_do_not_share_connectivity() {
    let pair = character_pair();
    assert_ne!(pair.source.mesh.vertex_count(), pair.target.mesh.vertex_count());
    // Only corners of the control cage are vertices of both.
    for (v, p) in pair.truth.iter().enumerate().filter(|(_, p)| p.barycentric.iter().any(|b| *b > 1.0 - 1e-9)) {
        let q = pair.target.vertex_parameter(v);
        let corner = |t: f64| t == 0.0 || t == 1.0;
        assert!(corner(q.u) && corner(q.v), "target vertex {v} is a vertex of source triangle {}", p.face);
    }
}

#[test]
fn anchors_are_nested_distinct_and_spread() {
    let pair = character_pair();
    let (source, target) = pair.anchors(93);
    assert_eq!((source.len(), target.len()), (93, 93));
    let (s, t) = pair.anchors(27);
    assert_eq!((s.as_slice(), t.as_slice()), (&source[..27], &target[..27]));
    for (i, a) in target.iter().enumerate() {
        assert_eq!(pair.true_source(a).position(&pair.source.mesh), source[i].position(&pair.source.mesh));
        let nearest = target[..i].iter().map(|b| a.position(&pair.target.mesh).distance(b.position(&pair.target.mesh)));
        assert!(nearest.fold(f64::INFINITY, f64::min) > 0.02);
    }
    assert!(pair.anchors(0).0.is_empty());
    assert_eq!(pair.anchors(usize::MAX).1.len(), pair.target.mesh.vertex_count());
}

/// Chart over each texel's centre; an error names a texel over which two triangles lie.
fn chart_map(character: &Character, size: usize) -> Result<Vec<u32>, String> {
    let mut map = vec![NONE; size * size];
    for t in 0..character.mesh.triangle_count() {
        let [a, b, c] = character.mesh.triangle_texcoords(t).unwrap().map(|uv| uv * size as f64);
        let area = (b - a).perp_dot(c - a);
        if area <= 0.0 {
            return Err(format!("triangle {t} is turned over"));
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        for y in low.y as usize..=high.y as usize {
            for x in low.x as usize..=high.x as usize {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let w = [(b - p).perp_dot(c - p), (c - p).perp_dot(a - p), (a - p).perp_dot(b - p)];
                if w.iter().all(|w| *w > 1e-9 * area) {
                    if map[y * size + x] != NONE {
                        return Err(format!("two triangles over texel ({x}, {y})"));
                    }
                    map[y * size + x] = character.charts[t];
                }
            }
        }
    }
    Ok(map)
}

#[test]
fn charts_lie_in_the_unit_square_apart_from_one_another() {
    const SIZE: usize = 1024;
    for character in [strider(), stout()] {
        let name = character.mesh.name.clone();
        assert!(
            character.mesh.texcoords.iter().all(|uv| uv.min_element() > 0.007 && uv.max_element() < 0.993),
            "{name}"
        );
        let map = chart_map(&character, SIZE).unwrap();
        let used = map.iter().filter(|c| **c != NONE).count();
        assert!(used * 2 > SIZE * SIZE, "{name}: {used} texels used");
        // No texel within 8 of one chart belongs to another.
        for (i, &chart) in map.iter().enumerate().filter(|(_, c)| **c != NONE) {
            let (x, y) = (i % SIZE, i / SIZE);
            let inner = x > 0 && x + 1 < SIZE && map[i - 1] == chart && map[i + 1] == chart;
            if inner && y > 0 && y + 1 < SIZE && map[i - SIZE] == chart && map[i + SIZE] == chart {
                continue;
            }
            for v in y.saturating_sub(8)..(y + 9).min(SIZE) {
                for u in x.saturating_sub(8)..(x + 9).min(SIZE) {
                    let other = map[v * SIZE + u];
                    assert!(other == NONE || other == chart, "{name}: charts {chart} and {other} meet at ({x}, {y})");
                }
            }
        }
        let mut wrong = character;
        let shift = wrong.mesh.texcoords[0] - wrong.mesh.texcoords[wrong.mesh.texcoords.len() - 1];
        let last = wrong.mesh.texcoords.len() - 1;
        wrong.mesh.texcoords[last] += shift;
        assert!(chart_map(&wrong, SIZE).is_err(), "{name}");
    }
}

#[test]
fn texels_are_shared_out_by_area() {
    for character in [strider(), stout()] {
        let mesh = &character.mesh;
        let mut ratios: Vec<(f64, f64)> = (0..mesh.triangle_count())
            .map(|t| {
                let [a, b, c] = mesh.triangle_texcoords(t).unwrap();
                (0.5 * (b - a).perp_dot(c - a) / mesh.triangle_area(t), mesh.triangle_area(t))
            })
            .collect();
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = ratios.iter().map(|r| r.1).sum();
        let quantile = |share: f64| {
            let mut sum = 0.0;
            ratios
                .iter()
                .find(|r| {
                    sum += r.1;
                    sum >= share * total
                })
                .unwrap()
                .0
        };
        let spread = quantile(0.95) / quantile(0.05);
        assert!(spread < 4.0, "{}: {spread}", mesh.name);
    }
}

fn sample(texture: &Image, uv: DVec2) -> [f64; 3] {
    let size = f64::from(texture.width);
    let (x, y) = (uv.x * size - 0.5, (1.0 - uv.y) * size - 0.5);
    let (i, j) = (x.floor(), y.floor());
    let (s, t) = (x - i, y - j);
    let at = |i: f64, j: f64, k: usize| f64::from(texture.pixel(i as u32, j as u32)[k]);
    [0, 1, 2].map(|k| {
        (at(i, j, k) * (1.0 - s) + at(i + 1.0, j, k) * s) * (1.0 - t)
            + (at(i, j + 1.0, k) * (1.0 - s) + at(i + 1.0, j + 1.0, k) * s) * t
    })
}

/// Mean colour step (0 to 255) between both sides of the seams, and the share of places where it is
/// above 40.
fn seam_steps(character: &Character, texture: &Image) -> (f64, f64) {
    let mesh = &character.mesh;
    let topology = Topology::new(mesh);
    let mut steps = Vec::new();
    for t in 0..mesh.triangle_count() {
        for k in 0..3 {
            let other = topology.neighbours[t][k];
            let uv = |t: usize, v: u32| {
                let corner = mesh.triangle_corners(t).into_iter().find(|c| c.vertex == v).unwrap();
                mesh.texcoords[corner.texcoord as usize]
            };
            let tri = mesh.triangle(t);
            let (a, b) = (tri[(k + 1) % 3], tri[(k + 2) % 3]);
            let (here, there) = ([uv(t, a), uv(t, b)], [uv(other as usize, a), uv(other as usize, b)]);
            if here == there || (other as usize) < t {
                continue;
            }
            for s in [0.25, 0.5, 0.75] {
                let (p, q) = (sample(texture, here[0].lerp(here[1], s)), sample(texture, there[0].lerp(there[1], s)));
                steps.push((0..3).map(|k| (p[k] - q[k]).abs()).fold(0.0, f64::max));
            }
        }
    }
    assert!(steps.len() > 100, "{}", mesh.name);
    let n = steps.len() as f64;
    (steps.iter().sum::<f64>() / n, steps.iter().filter(|s| **s > 40.0).count() as f64 / n)
}

#[test]
fn the_picture_crosses_seams_without_a_step() {
    for character in [strider(), stout()] {
        let texture = character.texture(1024);
        let (mean, high) = seam_steps(&character, &texture);
        assert!(mean < 4.0 && high < 0.03, "{}: mean {mean}, high {high}", character.mesh.name);
        let shifted = Image::from_fn(1024, 1024, |x, y| texture.pixel((x + 12) % 1024, y)).unwrap();
        let (mean, high) = seam_steps(&character, &shifted);
        assert!(mean > 8.0 && high > 0.06, "{}: mean {mean}, high {high}", character.mesh.name);
    }
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let in_pool = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let c = stout();
            (c.texture(200), c.mesh.positions, c.mesh.texcoords)
        })
    };
    assert!(in_pool(1) == in_pool(3));
}
