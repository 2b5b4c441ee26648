// Where the points of texels lie on the source: in space, in its texture, on which chart. Reference
// and explanation: tools::transfer::footprint::locate.

//#import lib/span
//#import lib/image
//#import lib/none
//#import lib/table
//#import lib/window
//#import lib/runs

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: WindowParams;
// atlas::AtlasTexel.
@group(0) @binding(2) var<storage, read> texels: array<vec4u>;
@group(0) @binding(3) var<storage, read> images: array<PackedImage>;
// Of each texel of the rows from span.place on: position and first texture coordinate; second one,
// triangle, chart, chart of the target; area and steps that a texel of the target has on the
// source.
@group(0) @binding(4) var<storage, read_write> located: array<vec4u>;
@group(0) @binding(5) var<storage, read> runs: array<u32>;
// tables::SourceTriangle, six texels; tables::TargetTriangle, one.
@group(0) @binding(6) var source: texture_2d<u32>;
@group(0) @binding(7) var target_: texture_2d<u32>;

// atlas::AtlasTexel::CENTRE.
const CENTRE: u32 = 1u;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let at = run_texel(runs[index >> RUN_BITS], index);
    if at.x >= params.width {
        return;
    }
    let place = kept_row(params, at.y) * params.width + at.x;
    let out = 3u * ((at.y - span.place) * params.width + at.x);
    let shown = texels[place];
    let face = images[place].face;
    // What most neighbours of a texel without image look at.
    located[out + 1u] = vec4u(0u, NONE, NONE, NONE);
    if shown.x != NONE && face != NONE {
        let image = images[place];
        let b = vec3f(image.b0, image.b1, 1.0 - image.b0 - image.b1);
        let r0 = texel_f32(source, 6u * face);
        let r1 = texel_f32(source, 6u * face + 1u);
        let r2 = texel_f32(source, 6u * face + 2u);
        let r3 = texel_f32(source, 6u * face + 3u);
        let chart = texel(source, 6u * face + 5u).z;
        let expected = texel(target_, shown.x);
        let p = b.x * r0.xyz + b.y * vec3f(r0.w, r1.xy) + b.z * vec3f(r1.zw, r2.x);
        let q = b.x * r2.yz + b.y * vec2f(r2.w, r3.x) + b.z * r3.yz;
        let target_chart = select(NONE, expected.x, (shown.w & CENTRE) != 0u);
        if chart != NONE && image.status != FAILED {
            located[out] = bitcast<vec4u>(vec4f(p, q.x));
            located[out + 1u] = vec4u(bitcast<u32>(q.y), face, chart, target_chart);
            located[out + 2u] = expected;
        }
    }
}
