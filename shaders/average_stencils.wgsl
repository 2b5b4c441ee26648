// Weighted averages in R^8 of surface points of a list, a row of indices and weights each.
// Reference and explanation: surface::stencils.
//
// The points are those of the step before, as the host packs them or as project_phong left them:
// steps go back and forth between two buffers.

//#import lib/span
//#import lib/phong

// Twin: surface::gpu::average_stencils::StencilParams.
struct StencilParams {
    // Words a point takes: the triangle and two coordinates come first.
    words: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: StencilParams;
@group(0) @binding(2) var<storage, read> points: array<u32>;
// Where each row begins, and the end of the last; then the rows: an index and a weight for each
// entry.
@group(0) @binding(3) var<storage, read> rows: array<u32>;
@group(0) @binding(4) var<storage, read_write> averages: array<vec4f>;
@group(0) @binding(5) var vertices: texture_2d<u32>;
@group(0) @binding(6) var triangles: texture_2d<u32>;

fn embedded(i: u32) -> Vector {
    let at = i * params.words;
    let v = texel(triangles, points[at] * TRIANGLE_TEXELS);
    let a = bitcast<f32>(points[at + 1u]);
    let b = bitcast<f32>(points[at + 2u]);
    let x = vec3f(a, b, 1.0 - a - b);
    return combine_vectors(x, vertex_point(vertices, v.x), vertex_point(vertices, v.y), vertex_point(vertices, v.z));
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = span.first + invocation(span, id);
    if i >= span.end {
        return;
    }
    let begin = rows[i];
    let end = rows[i + 1u];
    // Relative to the first point, so that only differences are rounded.
    let origin = embedded(rows[begin]);
    var mean = origin;
    for (var k = begin + 2u; k < end; k += 2u) {
        let w = bitcast<f32>(rows[k + 1u]);
        let d = sub_vector(embedded(rows[k]), origin);
        mean = Vector(mean.lo + w * d.lo, mean.hi + w * d.hi);
    }
    averages[2u * i] = mean.lo;
    averages[2u * i + 1u] = mean.hi;
}
