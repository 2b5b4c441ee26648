// Phong projection of points by local search, in R^8 or R^12, (paper, section 3.3): a walk over
// triangles from where the centroid of the target's triangle went; where that fails, from the
// nearest of three start vertices a walk over vertices, then one over triangles. Reference and
// explanation: surface::project and WeightedAverages::forward. What finds no root is left to the
// kernel search_phong.

//#import lib/span
//#import lib/points
//#import lib/projection

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: ProjectParams;
@group(0) @binding(2) var<storage, read> averages: array<vec4f>;
@group(0) @binding(3) var<storage, read> points: array<u32>;
@group(0) @binding(4) var<storage, read_write> results: array<Projected>;
@group(0) @binding(5) var vertices: texture_2d<u32>;
@group(0) @binding(6) var triangles: texture_2d<u32>;
// Around each vertex: a neighbour and the triangle between it and the one before (NONE for the
// first).
@group(0) @binding(7) var stops: texture_2d<u32>;
// Of each triangle of the target three vertices and a triangle to start from.
@group(0) @binding(8) var starts: texture_2d<u32>;

// project::WALK_PATIENCE.
const PATIENCE: f32 = 0.35;

fn distance_squared(v: u32, y: Vector) -> f32 {
    let d = sub_vector(vertex_point(vertices, v), y);
    return dot_vector(d, d);
}

// Where a walk over vertices ended: a vertex, its squared distance, and the triangle around it that
// faces the point; NONE where the walk did not come to its end.
struct Walked {
    v: u32,
    least: f32,
    face: u32,
}

fn walk_vertices(y: Vector, start: u32, distance: f32) -> Walked {
    var v = start;
    var least = distance;
    // One round over the stops finds the nearest neighbour and, with the sum of two stops in a row,
    // the facing triangle.
    for (var step = 0u; step < params.vertex_steps; step++) {
        let range = texel(vertices, v * VERTEX_TEXELS + 3u * VECTOR_TEXELS);
        var next = v;
        var before = 0.0;
        var facing = 1e30;
        var face = NONE;
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
            return Walked(v, least, face);
        }
        v = next;
    }
    return Walked(v, least, NONE);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let point = points[point_word(index)];
    // A record without point takes part in no loop.
    let shown = point != NONE;
    let at = index * params.stride + params.point;
    let y = vector_of(averages[at], averages[at + 1u], averages[at + VECTOR_TEXELS - 1u]);
    let begin = index * params.stride + params.reference;
    let reference = vector_of(averages[begin], averages[begin + 1u], averages[begin + VECTOR_TEXELS - 1u]);

    var own = 0u;
    if shown {
        own = point;
    }
    let start = texel(starts, own);
    var v = NONE;
    var least = 1e30;
    for (var k = select(3u, 0u, shown); k < 3u; k++) {
        if start[k] != NONE {
            let e = distance_squared(start[k], y);
            if e < least {
                least = e;
                v = start[k];
            }
        }
    }

    var result = unprojected(NOTHING);
    var face = start.w;
    for (var attempt = select(2u, 0u, shown); attempt < 2u; attempt++) {
        if attempt == 1u {
            if v == NONE {
                break;
            }
            let walked = walk_vertices(y, v, least);
            face = walked.face;
            least = walked.least;
            result.found = LEFT + VERTEX * walked.v;
        }
        var previous = NONE;
        for (var step = 0u; step < params.triangle_steps && face != NONE; step++) {
            let head = texel(triangles, face * TRIANGLE_TEXELS);
            let root = project_triangle(phong_system(vertices, triangles, face, head, y), PATIENCE);
            if root.inside {
                // A projection farther away than a vertex cannot be the closest one: the walk went
                // astray.
                let astray = projected(vertices, face, head, root.x, y, BY_WALK).distance_squared > least;
                if !astray || attempt == 1u {
                    let found = select(BY_WALK, result.found + ASTRAY, astray);
                    result = projected(vertices, face, head, root.x, reference, found);
                }
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
            if next == previous {
                break;
            }
            previous = face;
            face = next;
        }
        if result.found == BY_WALK {
            break;
        }
    }
    results[index] = result;
}
