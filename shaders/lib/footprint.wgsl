// Level and taps of a footprint. Reference: tools::transfer::sample::Taps.

//#import lib/wrap

// Footprints up to this much wider than a texel, or than a whole number of narrow sides, count as
// no wider; sample::SLACK.
const SLACK: f32 = 0.015625;

// sample::Filter.
const TRILINEAR: u32 = 1u;
const BILINEAR: u32 = 2u;

// Footprints wider than this see the mean of the whole picture; sample::LARGEST_FOOTPRINT.
const LARGEST_FOOTPRINT: f32 = 1e6;

// All in texels of level 0.
struct Taps {
    centre: vec2f,
    level: f32,
    along: u32,
    across: u32,
    wide: vec2f,
    narrow: vec2f,
}

// `centre` lies near the picture: see near_picture.
fn footprint_taps(centre: vec2f, dx_uv: vec2f, dy_uv: vec2f, size: vec2f, filtering: u32, most: f32) -> Taps {
    var taps = Taps(centre * size, 0.0, 1u, 1u, vec2f(), vec2f());
    let dx = dx_uv * size;
    let dy = dy_uv * size;
    // Beyond this squares grow out of range; what is no number is not below it either.
    let far = vec2f(10.0 * LARGEST_FOOTPRINT);
    if !all((abs(dx) < far) & (abs(dy) < far)) {
        taps.level = select(LARGEST_FOOTPRINT, 0.0, filtering == BILINEAR);
        return taps;
    }
    // Eigenvalues of M M^T are the squares of the widths.
    let a = dx.x * dx.x + dy.x * dy.x;
    let b = dx.x * dx.y + dy.x * dy.y;
    let c = dx.y * dx.y + dy.y * dy.y;
    let half = 0.5 * (a - c);
    let root = sqrt(half * half + b * b);
    let wide = sqrt(0.5 * (a + c) + root);
    if filtering == BILINEAR || wide <= 1.0 + SLACK {
        return taps;
    }
    if wide > LARGEST_FOOTPRINT {
        taps.level = LARGEST_FOOTPRINT;
        return taps;
    }
    if filtering == TRILINEAR {
        taps.level = log2(wide);
        return taps;
    }
    // The product of the widths is the determinant: no cancellation.
    let narrow = abs(dx.x * dy.y - dx.y * dy.x) / wide;
    // Distance of taps, and width of the boxes they see.
    let step = max(max(0.5 * narrow, wide / most), 1.0);
    taps.along = u32(clamp(-floor(SLACK - wide / step), 1.0, most));
    taps.across = select(1u, 2u, narrow / step > 1.0 + SLACK);
    let axis = select(vec2f(b, root - half), vec2f(half + root, b), half >= 0.0);
    let length = sqrt(axis.x * axis.x + axis.y * axis.y);
    var unit = vec2f(1.0, 0.0);
    if length > 0.0 {
        unit = axis / length;
    }
    taps.wide = unit * wide;
    taps.narrow = vec2f(-unit.y, unit.x) * narrow;
    if step > 1.0 {
        taps.level = log2(step);
    }
    return taps;
}

// Place of tap (i, j).
fn tap_place(taps: Taps, i: u32, j: u32) -> vec2f {
    let s = (f32(i) + 0.5) / f32(taps.along) - 0.5;
    let t = (f32(j) + 0.5) / f32(taps.across) - 0.5;
    return taps.centre + s * taps.wide + t * taps.narrow;
}
