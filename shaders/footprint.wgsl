// How the square of a texel is stretched on the source's texture, from where it and its neighbours
// lie. Reference and explanation: tools::transfer::footprint::footprint.

//#import lib/span
//#import lib/none
//#import lib/table
//#import lib/window
//#import lib/runs

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: WindowParams;
// What locate wrote, of the rows from span.place on.
@group(0) @binding(2) var<storage, read> located: array<vec4u>;
// Of each texel of the dispatch: centre and dx; dy, triangle of the source, nothing.
@group(0) @binding(3) var<storage, read_write> footprints: array<vec4u>;
@group(0) @binding(4) var<storage, read> runs: array<u32>;
// tables::SourceTriangle, six texels.
@group(0) @binding(5) var source: texture_2d<u32>;

// footprint::JUMP.
const JUMP: f32 = 8.0;
// footprint::AGREE.
const AGREE: f32 = 4.0;

// A texel's point on the source; footprint::Located.
struct Located {
    position: vec3f,
    texcoord: vec2f,
    face: u32,
    chart: u32,
    target_chart: u32,
}

fn located_at(index: u32) -> Located {
    let a = bitcast<vec4f>(located[3u * index]);
    let b = located[3u * index + 1u];
    return Located(a.xyz, vec2f(a.w, bitcast<f32>(b.x)), b.y, b.z, b.w);
}

// A difference in the texture; none where the neighbour does not count.
struct Difference {
    change: vec2f,
    counts: bool,
}

// The neighbour at `index`, if that is `inside` the picture.
fn difference(here: Located, inside: bool, index: u32, sign: f32, step: f32, gu: vec3f, gv: vec3f) -> Difference {
    let n = located_at(select(0u, index, inside));
    let d = sign * (n.position - here.position);
    let jump = JUMP * step;
    let counts = inside && here.target_chart != NONE && n.target_chart == here.target_chart && dot(d, d) <= jump * jump;
    let predicted = vec2f(dot(gu, d), dot(gv, d));
    let direct = sign * (n.texcoord - here.texcoord);
    let near = dot(direct, direct) <= AGREE * AGREE * dot(predicted, predicted);
    return Difference(select(predicted, direct, n.chart == here.chart && near), counts);
}

fn axis(a: Difference, b: Difference) -> Difference {
    let la = dot(a.change, a.change);
    let lb = dot(b.change, b.change);
    var both = 0.5 * (a.change + b.change);
    both = select(both, a.change, lb > AGREE * AGREE * la);
    both = select(both, b.change, la > AGREE * AGREE * lb);
    let one = select(b.change, a.change, a.counts);
    return Difference(select(one, both, a.counts && b.counts), a.counts || b.counts);
}

// A vector at a right angle to `v`, in texels, that spans `area` with it, within a factor of two of
// the side of a square of that area.
fn across(v: vec2f, area: f32, stretch: f32) -> vec2f {
    let side = sqrt(area);
    let w = vec2f(v.x * stretch, v.y / stretch);
    let length = sqrt(dot(w, w));
    if length > 0.0 {
        let other = clamp(area / length, 0.5 * side, 2.0 * side) / length;
        return vec2f(-w.y * other / stretch, w.x * other * stretch);
    }
    return vec2f(side / stretch, 0.0);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let number = invocation(span, id);
    let item = span.first + number;
    if item >= span.end {
        return;
    }
    let at = run_texel(runs[item >> RUN_BITS], item);
    let width = params.width;
    let out = 2u * number;
    let index = (at.y - span.place) * width + at.x;
    var face = NONE;
    if at.x < width {
        face = located[3u * index + 1u].y;
    }
    footprints[out + 1u] = vec4u(0u, 0u, face, 0u);
    if face != NONE {
        let here = located_at(index);
        let expected = bitcast<vec4f>(located[3u * index + 2u]);
        let r3 = texel_f32(source, 6u * face + 3u);
        let r4 = texel_f32(source, 6u * face + 4u);
        let r5 = texel_f32(source, 6u * face + 5u);
        let gu = vec3f(r3.w, r4.xy);
        let gv = vec3f(r4.zw, r5.x);
        let area = expected.y * r5.y;
        let stretch = r5.w;
        let left = difference(here, at.x > 0u, index - 1u, -1.0, expected.z, gu, gv);
        let right = difference(here, at.x + 1u < width, index + 1u, 1.0, expected.z, gu, gv);
        let above = difference(here, at.y > 0u, index - width, -1.0, expected.w, gu, gv);
        let below = difference(here, at.y + 1u < params.height, index + width, 1.0, expected.w, gu, gv);
        let x_axis = axis(left, right);
        let y_axis = axis(above, below);
        var dx = x_axis.change;
        var dy = y_axis.change;
        if !x_axis.counts && !y_axis.counts {
            let side = sqrt(area);
            dx = vec2f(side / stretch, 0.0);
            dy = vec2f(0.0, side * stretch);
        } else if !x_axis.counts {
            dx = across(dy, area, stretch);
        } else if !y_axis.counts {
            dy = across(dx, area, stretch);
        }
        footprints[out] = bitcast<vec4u>(vec4f(here.texcoord, dx));
        footprints[out + 1u] = vec4u(bitcast<vec2u>(dy), face, 0u);
    }
}
