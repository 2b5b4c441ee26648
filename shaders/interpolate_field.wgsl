// The image in R^12 of a point of the target: what its triangle's vertices have, interpolated.
// Reference and explanation: surface::field.

//#import lib/none
//#import lib/span
//#import lib/points
//#import lib/vector12

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<storage, read> points: array<u32>;
@group(0) @binding(2) var<storage, read_write> images: array<vec4f>;
// Of each triangle of the target its vertices.
@group(0) @binding(3) var triangles: texture_2d<u32>;
// Of each vertex of the target its image.
@group(0) @binding(4) var field: texture_2d<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let at = point_word(index);
    let face = points[at];
    if face != NONE {
        let v = texel(triangles, face) * VECTOR_TEXELS;
        let a = bitcast<f32>(points[at + 1u]);
        let b = bitcast<f32>(points[at + 2u]);
        let x = vec3f(a, b, 1.0 - a - b);
        let z = combine_vectors(x, texel_vector(field, v.x), texel_vector(field, v.y), texel_vector(field, v.z));
        images[3u * index] = z.a;
        images[3u * index + 1u] = z.b;
        images[3u * index + 2u] = z.c;
    }
}
