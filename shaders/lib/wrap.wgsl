// What pictures show beyond their borders. Reference: geometry::Wrap.

// By axis; geometry::Wrap.
const CLAMP: u32 = 1u;
const MIRROR: u32 = 2u;

// 0 where every picture repeats along both axes, which is what most do.
override MODES: u32 = 1u;

// Farther from a picture than this, in its sides, its border is all that a footprint sees;
// sample::FAR.
const FAR: f32 = 1000.0;

// Coordinates that show the same texels, brought near the picture. Reference:
// tools::transfer::sample::near_picture.
fn near_picture(x: vec2f, mode: vec2u) -> vec2f {
    if MODES == 0u {
        return x - floor(x);
    }
    let period = select(vec2f(1.0), vec2f(2.0), mode == vec2u(MIRROR));
    return select(x - period * floor(x / period), clamp(x, vec2f(-FAR), vec2f(FAR)), mode == vec2u(CLAMP));
}

// The texel of `n` a side that stands for one beyond the picture. Reference: geometry::Wrap::texel.
fn wrap(index: vec2i, n: vec2i, mode: vec2u) -> vec2i {
    if MODES == 0u {
        let rest = index % n;
        return select(rest, rest + n, rest < vec2i(0));
    }
    let period = select(n, 2 * n, mode == vec2u(MIRROR));
    let r = index % period;
    let inside = select(r, r + period, r < vec2i(0));
    let folded = select(inside, period - 1 - inside, inside >= n);
    return select(folded, clamp(index, vec2i(0), n - 1), mode == vec2u(CLAMP));
}
