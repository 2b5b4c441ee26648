// Phong projection of points of R^8 by local search: nearest of three start vertices, walk over vertices, walk over
// triangles (paper, section 3.3). Reference and explanation: surface::project. What finds no root is left to the
// kernel search_phong with the vertex the walk ended at.

//#import lib/span
//#import lib/projection

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: ProjectParams;
@group(0) @binding(2) var<storage, read> averages: array<vec4f>;
@group(0) @binding(3) var<storage, read> points: array<u32>;
@group(0) @binding(4) var<storage, read_write> results: array<Projected>;
@group(0) @binding(5) var vertices: texture_2d<u32>;
@group(0) @binding(6) var triangles: texture_2d<u32>;
// Around each vertex: a neighbour and the triangle between it and the one before (NONE for the first).
@group(0) @binding(7) var stops: texture_2d<u32>;
// Of each triangle of the target three vertices to start from.
@group(0) @binding(8) var starts: texture_2d<u32>;

// project::WALK_PATIENCE.
const PATIENCE: f32 = 0.35;

fn distance_squared(v: u32, y: Vec8) -> f32 {
    let d = sub8(vertex_point(vertices, v), y);
    return dot8(d, d);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = span.first + invocation(span, id);
    if i >= span.end {
        return;
    }
    let at = i * params.stride + params.point;
    let y = Vec8(averages[at], averages[at + 1u]);
    let begin = i * params.stride + params.reference;
    let reference = Vec8(averages[begin], averages[begin + 1u]);

    let start = texel(starts, points[3u * i] * params.start_stride).xyz;
    var v = NONE;
    var least = 1e30;
    for (var k = 0u; k < 3u; k++) {
        if start[k] != NONE {
            let e = distance_squared(start[k], y);
            if e < least {
                least = e;
                v = start[k];
            }
        }
    }
    if v == NONE {
        results[i] = unprojected(NONE, y, reference, NOTHING);
        return;
    }

    // One round over the stops finds the nearest neighbour and, with the sum of two stops in a row, the triangle facing y.
    var face = NONE;
    var settled = false;
    for (var step = 0u; step < params.vertex_steps; step++) {
        let range = texel(vertices, v * VERTEX_TEXELS + 6u);
        var next = v;
        var before = 0.0;
        var facing = 1e30;
        face = NONE;
        for (var k = 0u; k < range.y; k++) {
            let stop = texel(stops, range.x + k);
            let e = distance_squared(stop.x, y);
            if e < least || (e == least && next != v && stop.x < next) {
                least = e;
                next = stop.x;
            }
            let sum = before + e;
            if stop.y != NONE && (sum < facing || (sum == facing && stop.y < face)) {
                facing = sum;
                face = stop.y;
            }
            before = e;
        }
        if next == v {
            settled = true;
            break;
        }
        v = next;
    }

    var result = unprojected(NONE, y, reference, LEFT + VERTEX * v);
    if settled && face != NONE {
        var previous = NONE;
        for (var step = 0u; step < params.triangle_steps; step++) {
            let head = texel(triangles, face * TRIANGLE_TEXELS);
            let root = project_triangle(phong_system(vertices, triangles, face, head, y), PATIENCE);
            if root.inside {
                // A projection farther away than a vertex cannot be the closest one: the walk went astray.
                let astray = projected(vertices, face, head, root.x, result, y, BY_WALK).distance_squared > least;
                let found = select(BY_WALK, LEFT + ASTRAY + VERTEX * v, astray);
                result = projected(vertices, face, head, root.x, result, reference, found);
                break;
            }
            let across = texel(triangles, face * TRIANGLE_TEXELS + 1u);
            var next = across.x;
            var lowest = root.x.x;
            if root.x.y < lowest {
                lowest = root.x.y;
                next = across.y;
            }
            if root.x.z < lowest {
                next = across.z;
            }
            if next == NONE || next == previous {
                break;
            }
            previous = face;
            face = next;
        }
    }
    results[i] = result;
}
