// The ellipse that a pixel of the result sees of a picture. Reference: picture::ellipse.

const VARIANCE: f32 = 0.225;
const MOMENT: f32 = 10.0;
const FINEST: f32 = 1.5;
const LONGEST: f32 = 16.0;
const INTERPOLATED: f32 = 1.015625;
const AVERAGED: f32 = 1.5;

struct Ellipse {
    level: u32,
    // Share of the average in the result; the rest is interpolated.
    share: f32,
    // q = x dx^2 + y dx dy + z dy^2, 1 on the border, in texels of the level.
    form: vec3f,
    // Half its extent.
    reach: vec2f,
}

// `most` is 2^levels.
fn ellipse(d0: vec2f, d1: vec2f, levels: u32, most: f32) -> Ellipse {
    let dx = clamp(d0, vec2f(-most), vec2f(most));
    let dy = clamp(d1, vec2f(-most), vec2f(most));
    let a = dx.x * dx.x + dy.x * dy.x;
    let b = dx.x * dx.y + dy.x * dy.y;
    let c = dx.y * dx.y + dy.y * dy.y;
    let mean = 0.5 * (a + c);
    let half = 0.5 * (a - c);
    let root = sqrt(half * half + b * b);
    let wide_0 = sqrt(mean + root);
    var narrow_0 = 0.0;
    if wide_0 > 0.0 {
        narrow_0 = abs(dx.x * dy.y - dx.y * dy.x) / wide_0;
    }
    let part = clamp((wide_0 - INTERPOLATED) / (AVERAGED - INTERPOLATED), 0.0, 1.0);
    let wide = max(wide_0, 1.0);
    let narrow = max(max(narrow_0, 1.0), wide * (1.0 / LONGEST));
    var e: Ellipse;
    e.share = part * part * (3.0 - 2.0 * part);
    e.level = 0u;
    var scale = 1.0;
    for (var i = 1u; i < levels; i++) {
        if narrow * scale < 2.0 * FINEST {
            break;
        }
        e.level = i;
        scale *= 0.5;
    }
    let boxed = (1.0 - scale * scale) * (1.0 / 12.0);
    let long = MOMENT * max(VARIANCE * (wide * scale) * (wide * scale) - boxed, VARIANCE);
    let short = MOMENT * max(VARIANCE * (narrow * scale) * (narrow * scale) - boxed, VARIANCE);
    var axis = vec2f(b, root - half);
    if half >= 0.0 {
        axis = vec2f(half + root, b);
    }
    let length = sqrt(axis.x * axis.x + axis.y * axis.y);
    var u = vec2f(1.0, 0.0);
    if length > 0.0 {
        u = axis / length;
    }
    let along = 1.0 / long;
    let across = 1.0 / short;
    e.form = vec3f(along * u.x * u.x + across * u.y * u.y, 2.0 * (along - across) * u.x * u.y, along * u.y * u.y + across * u.x * u.x);
    e.reach = vec2f(sqrt(long * u.x * u.x + short * u.y * u.y), sqrt(long * u.y * u.y + short * u.x * u.x));
    return e;
}
