//! Anchors: dots in colours that tell neighbours apart, and their numbers.

use glam::{DVec2, DVec3};

use super::RenderOptions;
use super::camera::Camera;
use super::canvas::Canvas;
use crate::geometry::{Mesh, SurfacePoint};

/// Digits of three by five dots, rows from the top, the left dot in the highest bit.
const DIGITS: [[u8; 5]; 10] = [
    [7, 5, 5, 5, 7],
    [2, 6, 2, 2, 7],
    [7, 1, 7, 4, 7],
    [7, 1, 3, 1, 7],
    [5, 5, 7, 1, 1],
    [7, 4, 7, 1, 7],
    [7, 4, 7, 5, 7],
    [7, 1, 2, 2, 2],
    [7, 5, 7, 5, 7],
    [7, 5, 7, 1, 7],
];

/// The colour of anchor `i`: hues a golden angle apart, sRGB.
fn anchor_color(i: usize) -> [u8; 3] {
    let hue = (i as f64 * 0.618_033_988_749_895).fract() * 6.0;
    [5.0, 3.0, 1.0].map(|n: f64| {
        let k = (n + hue).rem_euclid(6.0);
        let c = 1.0 - 0.85 * k.min(4.0 - k).clamp(0.0, 1.0);
        (c * 245.0 + 0.5) as u8
    })
}

/// Draws the anchors that are not hidden behind the shape.
pub(super) fn draw_anchors(
    picture: &mut Canvas,
    depths: &[f32],
    mesh: &Mesh,
    anchors: &[SurfacePoint],
    camera: &Camera,
    options: &RenderOptions,
) {
    let smaller = f64::from(options.width.min(options.height));
    let radius =
        if options.anchor_radius > 0.0 { options.anchor_radius.min(smaller) } else { (smaller / 180.0).max(2.0) };
    for (i, anchor) in anchors.iter().enumerate() {
        if (anchor.face as usize) >= mesh.triangle_count() {
            continue;
        }
        let position = camera.frame.place(anchor, mesh);
        // Lifted towards the camera by a little more than the surface may bend below the dot.
        let lifted: DVec3 = camera.project_local(position + camera.back * (0.02 * camera.radius));
        let p = camera.project_local(position);
        let inside = p.is_finite()
            && p.x >= 0.0
            && p.y >= 0.0
            && p.x < f64::from(options.width)
            && p.y < f64::from(options.height);
        if !inside || lifted.z as f32 > depths[p.y as usize * options.width as usize + p.x as usize] {
            continue;
        }
        disc(picture, p.truncate(), radius + (0.3 * radius).max(1.0), [255, 255, 255]);
        disc(picture, p.truncate(), radius, anchor_color(i));
        if options.anchor_numbers {
            number(picture, i, p.truncate() + DVec2::new(1.6 * radius, -1.6 * radius), (radius / 3.0).max(1.0) as i64);
        }
    }
}

fn disc(picture: &mut Canvas, centre: DVec2, radius: f64, color: [u8; 3]) {
    let (w, h) = (i64::from(picture.width), i64::from(picture.height));
    let r = radius.ceil() as i64 + 1;
    let (cx, cy) = (centre.x as i64, centre.y as i64);
    for y in (cy - r).max(0)..=(cy + r).min(h - 1) {
        for x in (cx - r).max(0)..=(cx + r).min(w - 1) {
            let distance = DVec2::new(x as f64 + 0.5, y as f64 + 0.5).distance(centre);
            let cover = (radius - distance + 0.5).clamp(0.0, 1.0);
            if cover > 0.0 {
                picture.blend(x as u32, y as u32, color, cover as f32);
            }
        }
    }
}

fn number(picture: &mut Canvas, i: usize, at: DVec2, dot: i64) {
    let (w, h) = (i64::from(picture.width), i64::from(picture.height));
    let (x0, y0) = (at.x as i64, at.y as i64 - 5 * dot);
    let mut fill = |x: i64, y: i64, grow: i64, color: [u8; 3]| {
        for y in (y - grow).max(0)..(y + dot + grow).min(h) {
            for x in (x - grow).max(0)..(x + dot + grow).min(w) {
                picture.blend(x as u32, y as u32, color, 1.0);
            }
        }
    };
    // A white outline first, then the digits.
    for (grow, color) in [(1, [255, 255, 255]), (0, [20, 20, 30])] {
        for (k, digit) in i.to_string().bytes().enumerate() {
            for (row, bits) in DIGITS[usize::from(digit - b'0')].iter().enumerate() {
                for column in 0..3 {
                    if bits >> (2 - column) & 1 == 1 {
                        fill(x0 + (4 * k as i64 + column) * dot, y0 + row as i64 * dot, grow, color);
                    }
                }
            }
        }
    }
}
