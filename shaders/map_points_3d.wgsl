// Points through one step of a composite map in space. Reference: mapping::space::Step.

//#import lib/span
//#import lib/angle
//#import lib/faces
//#import lib/mean_value_3d

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: SpaceParams;
@group(0) @binding(2) var<uniform> faces0: array<vec4f, 1024>;
@group(0) @binding(3) var<uniform> faces1: array<vec4f, 1024>;
@group(0) @binding(4) var<uniform> faces2: array<vec4f, 1024>;
@group(0) @binding(5) var<uniform> faces3: array<vec4f, 1024>;
@group(0) @binding(6) var<storage, read> points: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> images: array<vec4f>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let x = points[index].xyz;
    var weight = 0.0;
    var moved = vec3f();
    // The nearest corner and its displacement.
    var least = HUGE;
    var corner = vec3f();
    for (var k = 0u; k < params.faces; k++) {
        let f = face(k);
        let seen = view(f, x);
        let h = seen.h;
        let h2 = h * h;
        take_nearest(f, seen, &least, &corner);
        let p0 = edge_part(f.e0.w, seen.b.x, h2, dot(f.e0.xyz, seen.a1), dot(f.e0.xyz, seen.a2));
        let p1 = edge_part(f.e1.w, seen.b.y, h2, dot(f.e1.xyz, seen.a2), dot(f.e1.xyz, seen.a0));
        let p2 = edge_part(f.e2.w, seen.b.z, h2, dot(f.e2.xyz, seen.a0), dot(f.e2.xyz, seen.a1));
        let inside = select(PI, 0.0, min(min(seen.b.x, seen.b.y), seen.b.z) < 0.0);
        let w = h * (inside / h2 - 0.5 * (p0.k + p1.k + p2.k));
        let tangent = slope(f, p0.e * seen.m0 + p1.e * seen.m1 + p2.e * seen.m2);
        weight += w;
        moved += w * displacement(f, seen.a0) + 0.5 * h * tangent;
    }
    let by = select(moved / weight, corner, least < AT_VERTEX_3D);
    images[index] = vec4f(x + by, 0.0);
}
