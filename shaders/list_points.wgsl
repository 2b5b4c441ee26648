// The points that the texels of runs show, one after the other, and the places of their images.

//#import lib/span
//#import lib/none
//#import lib/window
//#import lib/runs

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: WindowParams;
@group(0) @binding(2) var<storage, read> runs: array<u32>;
// atlas::AtlasTexel.
@group(0) @binding(3) var<storage, read> texels: array<vec4u>;
// Of each texel of the dispatch its point and where its image belongs; no triangle where it shows
// nothing.
@group(0) @binding(4) var<storage, read_write> points: array<vec4u>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let number = invocation(span, id);
    let index = span.first + number;
    if index >= span.end {
        return;
    }
    let at = run_texel(runs[index >> RUN_BITS], index);
    var point = vec4u(NONE, 0u, 0u, 0u);
    if at.x < params.width {
        let place = kept_row(params, at.y) * params.width + at.x;
        point = vec4u(texels[place].xyz, place);
    }
    points[number] = point;
}
