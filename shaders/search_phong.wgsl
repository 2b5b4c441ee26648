// Second pass of the forward problem, over the points that project_phong left: the nearest root of
// the first level of triangles around the vertex that has one (paper, section 3.3). Reference and
// explanation: surface::search. The order of the triangles is worked out beforehand
// (surface::gpu::tables), because a queue in every lane would be ruinous. What finds nothing here
// goes through the reference and its longer search.

//#import lib/span
//#import lib/projection

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: ProjectParams;
@group(0) @binding(2) var<storage, read> averages: array<vec4f>;
// The number of points left, then their indices.
@group(0) @binding(3) var<storage, read> list: array<u32>;
@group(0) @binding(4) var<storage, read_write> results: array<Projected>;
@group(0) @binding(5) var vertices: texture_2d<u32>;
@group(0) @binding(6) var triangles: texture_2d<u32>;
@group(0) @binding(7) var bounds: texture_2d<u32>;
// Triangles around each vertex, four to a texel; the first of each level is marked.
@group(0) @binding(8) var near: texture_2d<u32>;

// project::SEARCH_PATIENCE.
const PATIENCE: f32 = 2.0;
// project::BESIDE.
const BESIDE: f32 = 1e-4;
// project::ASIDE.
const ASIDE: f32 = 1e-2;
// search::NEW_LEVEL.
const NEW_LEVEL: u32 = 0x80000000u;

// Texels of a bound of a triangle.
const BOUND_TEXELS: u32 = 3u * VECTOR_TEXELS + 1u;

// Whether the triangle can hold a root; search::TriangleBound.
fn admits(face: u32, y: Vector) -> bool {
    let i = face * BOUND_TEXELS;
    let d = sub_vector(texel_vector(bounds, i), y);
    let a = dot_vector(texel_vector(bounds, i + VECTOR_TEXELS), d);
    let b = dot_vector(texel_vector(bounds, i + 2u * VECTOR_TEXELS), d);
    let reach = texel_f32(bounds, i + 3u * VECTOR_TEXELS);
    let most = reach.x + reach.y * sqrt(dot_vector(d, d));
    return a * a + b * b <= most * most;
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    // Few points are left: an invocation for each would mostly find none, and a software device
    // does the work of a masked lane all the same.
    for (var item = invocation(span, id); item < list[0]; item += groups.x * groups.y * GROUP) {
        search(list[item + 1u]);
    }
}

fn search(i: u32) {
    let at = i * params.stride + params.point;
    let y = vector_of(averages[at], averages[at + 1u], averages[at + VECTOR_TEXELS - 1u]);
    let begin = i * params.stride + params.reference;
    let reference = vector_of(averages[begin], averages[begin + 1u], averages[begin + VECTOR_TEXELS - 1u]);

    let walked = results[i];
    let range = texel(vertices, (walked.found / VERTEX) * VERTEX_TEXELS + 3u * VECTOR_TEXELS);
    let aside = sub_vector(vertex_point(vertices, walked.found / VERTEX), y);
    let most = select(1e30, ASIDE, dot_vector(aside, aside) <= BESIDE);
    var best = unprojected(walked.found);
    var root = vec3f();
    var k = 0u;
    // Each lane goes on to its next triangle that can hold a root before all look for one together:
    // the look is a hundred times as long as the test, and few triangles pass it.
    for (var round = 0u; round < range.w; round++) {
        var face = NONE;
        for (; k < range.w && face == NONE; k++) {
            let entry = texel(near, range.z + k / 4u)[k % 4u];
            if (entry & NEW_LEVEL) != 0u && best.face != NONE {
                k = range.w;
            } else if admits(entry & ~NEW_LEVEL, y) {
                face = entry & ~NEW_LEVEL;
            }
        }
        if face == NONE {
            break;
        }
        let head = texel(triangles, face * TRIANGLE_TEXELS);
        let r = project_triangle(phong_system(vertices, triangles, face, head, y), PATIENCE);
        if r.inside {
            let c = projected(vertices, face, head, r.x, y, BY_SEARCH);
            let closer = best.face == NONE || c.distance_squared < best.distance_squared
                || (c.distance_squared == best.distance_squared && face < best.face);
            if closer && c.distance_squared <= most {
                best = c;
                root = r.x;
            }
        }
    }

    if (walked.found & ASTRAY) != 0u && range.w != 0u {
        let head = texel(triangles, walked.face * TRIANGLE_TEXELS);
        let x = vec3f(walked.b0, walked.b1, 1.0 - walked.b0 - walked.b1);
        let c = projected(vertices, walked.face, head, x, y, BY_WALK);
        if c.distance_squared <= select(best.distance_squared, most, best.face == NONE) {
            best = c;
            root = x;
        }
    }
    if best.face != NONE {
        let head = texel(triangles, best.face * TRIANGLE_TEXELS);
        results[i] = projected(vertices, best.face, head, root, reference, best.found);
    }
}
