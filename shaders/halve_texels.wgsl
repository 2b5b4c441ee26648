// The next level of a picture: means of two by two texels, each counting as the pixels it has.
// Reference: tools::warp::pyramid. span.place is the level that is made, its texels are the items.

//#import lib/span
//#import lib/halvings

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: HalvingParams;
@group(0) @binding(2) var<storage, read_write> halvings: array<vec4f>;
@group(0) @binding(3) var base: texture_2d<u32>;
@group(0) @binding(4) var light: texture_2d<u32>;

// Pixels along a side of `n` that texel `i` of the level below has.
fn pixels(i: u32, n: u32, below: u32) -> f32 {
    return f32(min((i + 1u) << below, n) - (i << below));
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let item = span.first + invocation(span, id);
    if item >= span.end {
        return;
    }
    let below = span.place - 1u;
    let to = params.places[span.place];
    let lower = params.places[below];
    let x = item % to.y;
    let y = item / to.y;
    var sum = vec4f();
    var weight = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let i = 2u * x + k % 2u;
        let j = 2u * y + k / 2u;
        if i < lower.y && j < lower.z {
            let share = pixels(i, params.width, below) * pixels(j, params.height, below);
            var value: vec4f;
            if below == 0u {
                value = stored_texel(base, light, params, vec2i(i32(i), i32(j)));
            } else {
                value = halvings[lower.x + j * lower.y + i];
            }
            sum += share * value;
            weight += share;
        }
    }
    halvings[to.x + item] = sum / weight;
}
