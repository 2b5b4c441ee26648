// The mean value map of four points at once: component k of every vec4f belongs to point k. The
// form and the reason for each of its branches are explained at the reference,
// mapping::plane::mean_value.
//
// The kernel that imports this declares
//   fn corner(i: u32) -> vec4f   vertex i: position, displacement
//   fn ring(l: u32) -> vec2u     loop l: its first vertex, one past its last; at least two of them

// Squared distance below which a point is at a vertex; mean_value::AT_VERTEX.
const AT_VERTEX: f32 = 1e-30;

// Stands in for an area that is zero, so that a weight it divides is a number yet.
const ON_EDGE: f32 = 1e-18;

// Whether terms are added up by blocks before they are added to the rest, as many vertices need;
// mean_value::BLOCK. Software devices pay for every loop around a loop.
override BLOCKED: bool = false;
const BLOCK: u32 = 32u;

// No edge.
const NONE: u32 = 0xffffffffu;

// What the first pass over the edges finds: the nearest vertex, its squared distance and
// displacement; tau and its gradient, and the edge that sets it (none where no angle is obtuse).
struct Scan {
    nearest: vec4u,
    square: vec4f,
    base_x: vec4f,
    base_y: vec4f,
    widest: vec4u,
    tau: vec4f,
    slope_x: vec4f,
    slope_y: vec4f,
}

// One end of an edge, seen from the points; `x / square` and `y / square` are the gradient of its
// direction.
struct Ray {
    x: vec4f,
    y: vec4f,
    square: vec4f,
    r: vec4f,
    inverse: vec4f,
    turn_x: vec4f,
    turn_y: vec4f,
}

// T of an edge and its gradient.
struct Half {
    t: vec4f,
    x: vec4f,
    y: vec4f,
}

// Sums over the vertices; and in the end image minus point and derivative minus identity, row by
// row.
struct Sums {
    weight: vec4f,
    moment_x: vec4f,
    moment_y: vec4f,
    moved_x: vec4f,
    moved_y: vec4f,
    weight_x: vec4f,
    weight_y: vec4f,
    xx: vec4f,
    xy: vec4f,
    yx: vec4f,
    yy: vec4f,
}

fn ray(x: vec4f, y: vec4f) -> Ray {
    let square = x * x + y * y;
    let r = sqrt(square);
    let inverse = 1.0 / r;
    let scale = inverse * inverse;
    return Ray(x, y, square, r, inverse, x * scale, y * scale);
}

// A, with the digits of the nearer end.
fn area(ax: vec4f, ay: vec4f, a: vec4f, bx: vec4f, by: vec4f, b: vec4f, edge_x: vec4f, edge_y: vec4f) -> vec4f {
    let near = b < a;
    return select(ax, bx, near) * edge_y - select(ay, by, near) * edge_x;
}

fn scan(px: vec4f, py: vec4f, loops: u32) -> Scan {
    var found: Scan;
    found.square = vec4f(1e30);
    found.widest = vec4u(NONE);
    // |A| and -D of the widest so far; with these numbers any obtuse angle wins.
    var best_area = vec4f(1.0);
    var best_product = vec4f(0.0);
    var after: vec4u;
    for (var l = 0u; l < loops; l++) {
        let range = ring(l);
        var here = corner(range.x);
        var ax = here.x - px;
        var ay = here.y - py;
        var a = ax * ax + ay * ay;
        for (var i = range.x; i < range.y; i++) {
            let next = select(i + 1u, range.x, i + 1u == range.y);
            let there = corner(next);
            let bx = there.x - px;
            let by = there.y - py;
            let b = bx * bx + by * by;
            let closer = a < found.square;
            found.square = select(found.square, a, closer);
            found.nearest = select(found.nearest, vec4u(i), closer);
            let edge = there.xy - here.xy;
            let size = abs(area(ax, ay, a, bx, by, b, vec4f(edge.x), vec4f(edge.y)));
            let product = ax * bx + ay * by;
            // |A / D| falls as an obtuse angle widens; the products compare the quotients.
            let wider = size * best_product + best_area * product < vec4f(0.0);
            best_area = select(best_area, size, wider);
            best_product = select(best_product, -product, wider);
            found.widest = select(found.widest, vec4u(i), wider);
            after = select(after, vec4u(next), wider);
            here = there;
            ax = bx;
            ay = by;
            a = b;
        }
    }
    // What belongs to the winners is fetched once, for it would be selected once an edge otherwise.
    let qx = corner(found.nearest.x);
    let qy = corner(found.nearest.y);
    let qz = corner(found.nearest.z);
    let qw = corner(found.nearest.w);
    found.base_x = vec4f(qx.z, qy.z, qz.z, qw.z);
    found.base_y = vec4f(qx.w, qy.w, qz.w, qw.w);
    let none = found.widest == vec4u(NONE);
    let index = select(found.widest, vec4u(0u), none);
    let ax = corner(index.x);
    let ay = corner(index.y);
    let az = corner(index.z);
    let aw = corner(index.w);
    let bx = corner(after.x);
    let by = corner(after.y);
    let bz = corner(after.z);
    let bw = corner(after.w);
    let vx = vec4f(ax.x, ay.x, az.x, aw.x);
    let vy = vec4f(ax.y, ay.y, az.y, aw.y);
    let wx = vec4f(bx.x, by.x, bz.x, bw.x);
    let wy = vec4f(bx.y, by.y, bz.y, bw.y);
    let start = ray(vx - px, vy - py);
    let stop = ray(wx - px, wy - py);
    let signed = area(start.x, start.y, start.square, stop.x, stop.y, stop.square, wx - vx, wy - vy);
    found.tau = select(signed / (start.r * stop.r + best_product), vec4f(1.0), none);
    let factor = -0.5 - 0.5 * found.tau * found.tau;
    found.slope_x = select(factor * (stop.turn_y - start.turn_y), vec4f(0.0), none);
    found.slope_y = select(factor * (start.turn_x - stop.turn_x), vec4f(0.0), none);
    return found;
}

fn half_edge(found: Scan, i: u32, a: Ray, b: Ray, edge: vec2f) -> Half {
    let size = area(a.x, a.y, a.square, b.x, b.y, b.square, vec4f(edge.x), vec4f(edge.y));
    let product = a.x * b.x + a.y * b.y;
    let sum = a.r * b.r + abs(product);
    let obtuse = product < vec4f(0.0);
    let t = select(size, sum, obtuse) / select(sum, size, obtuse);
    let scaled = found.tau * t;
    let widest = found.widest == vec4u(i);
    let factor = 0.5 * (found.tau + scaled * t);
    return Half(
        select(scaled, vec4f(1.0), widest),
        select(factor * (b.turn_y - a.turn_y) + t * found.slope_x, vec4f(0.0), widest),
        select(factor * (a.turn_x - b.turn_x) + t * found.slope_y, vec4f(0.0), widest),
    );
}

fn add_vertex(sums: ptr<function, Sums>, found: Scan, scale: vec4f, vertex: vec4f, at: Ray, before: Half, after: Half) {
    let c = scale * at.inverse;
    let w = c * (before.t + after.t);
    let ux = vertex.z - found.base_x;
    let uy = vertex.w - found.base_y;
    let gx = c * (before.x + after.x) + w * at.turn_x;
    let gy = c * (before.y + after.y) + w * at.turn_y;
    (*sums).weight += w;
    (*sums).moment_x += w * vertex.x;
    (*sums).moment_y += w * vertex.y;
    (*sums).moved_x += w * ux;
    (*sums).moved_y += w * uy;
    (*sums).weight_x += gx;
    (*sums).weight_y += gy;
    (*sums).xx += ux * gx;
    (*sums).xy += ux * gy;
    (*sums).yx += uy * gx;
    (*sums).yy += uy * gy;
}

fn join_block(sums: ptr<function, Sums>, block: ptr<function, Sums>) {
    (*sums).weight += (*block).weight;
    (*sums).moment_x += (*block).moment_x;
    (*sums).moment_y += (*block).moment_y;
    (*sums).moved_x += (*block).moved_x;
    (*sums).moved_y += (*block).moved_y;
    (*sums).weight_x += (*block).weight_x;
    (*sums).weight_y += (*block).weight_y;
    (*sums).xx += (*block).xx;
    (*sums).xy += (*block).xy;
    (*sums).yx += (*block).yx;
    (*sums).yy += (*block).yy;
}

// The vertex that comes next along a loop, and the half edge to it.
struct Walk {
    here: vec4f,
    ray: Ray,
    before: Half,
}

// Adds the vertices from `first` to below `end` of a loop.
fn add_vertices(
    sums: ptr<function, Sums>,
    walk: ptr<function, Walk>,
    found: Scan,
    scale: vec4f,
    px: vec4f,
    py: vec4f,
    range: vec2u,
    first: u32,
    end: u32,
) {
    for (var i = first; i < end; i++) {
        let there = corner(select(i + 1u, range.x, i + 1u == range.y));
        let b = ray(there.x - px, there.y - py);
        let after = half_edge(found, i, (*walk).ray, b, there.xy - (*walk).here.xy);
        add_vertex(sums, found, scale, (*walk).here, (*walk).ray, (*walk).before, after);
        (*walk).here = there;
        (*walk).ray = b;
        (*walk).before = after;
    }
}

fn mean_value(found: Scan, px: vec4f, py: vec4f, loops: u32, far: f32) -> Sums {
    var sums: Sums;
    let scale = sqrt(found.square);
    for (var l = 0u; l < loops; l++) {
        let range = ring(l);
        // The first vertex of a loop waits for its last edge.
        let first = corner(range.x);
        let first_ray = ray(first.x - px, first.y - py);
        let here = corner(range.x + 1u);
        let a = ray(here.x - px, here.y - py);
        let leaving = half_edge(found, range.x, first_ray, a, here.xy - first.xy);
        var walk = Walk(here, a, leaving);
        if BLOCKED {
            for (var start = range.x + 1u; start < range.y; start += BLOCK) {
                var block = Sums();
                add_vertices(&block, &walk, found, scale, px, py, range, start, min(start + BLOCK, range.y));
                join_block(&sums, &block);
            }
        } else {
            add_vertices(&sums, &walk, found, scale, px, py, range, range.x + 1u, range.y);
        }
        add_vertex(&sums, found, scale, first, first_ray, walk.before, leaving);
    }
    // Far away the sum of the weights is taken from their moment, which cancels less.
    let square = px * px + py * py;
    let away = square > vec4f(far);
    let moment = sums.moment_x * px + sums.moment_y * py;
    let inverse = select(vec4f(1.0), square, away) / select(sums.weight, moment, away);
    let mx = sums.moved_x * inverse;
    let my = sums.moved_y * inverse;
    return Sums(
        sums.weight,
        sums.moment_x,
        sums.moment_y,
        found.base_x + mx,
        found.base_y + my,
        sums.weight_x,
        sums.weight_y,
        (sums.xx - mx * sums.weight_x) * inverse,
        (sums.xy - mx * sums.weight_y) * inverse,
        (sums.yx - my * sums.weight_x) * inverse,
        (sums.yy - my * sums.weight_y) * inverse,
    );
}

// Image minus point alone, and what says whether a point is at a vertex.
struct Moved {
    x: vec4f,
    y: vec4f,
    nearest: vec4u,
    square: vec4f,
}

// t of an edge; on the edge itself, where it is infinite, so large that only its two ends count.
fn half_tangent(a: Ray, b: Ray, edge: vec2f) -> vec4f {
    let size = area(a.x, a.y, a.square, b.x, b.y, b.square, vec4f(edge.x), vec4f(edge.y));
    let product = a.x * b.x + a.y * b.y;
    let sum = a.r * b.r + abs(product);
    let obtuse = product < vec4f(0.0);
    let below = select(size, vec4f(ON_EDGE), abs(size) < vec4f(ON_EDGE));
    return select(size, sum, obtuse) / select(sum, below, obtuse);
}

// Weight, moment and displacement.
struct MapSums {
    weight: vec4f,
    moment_x: vec4f,
    moment_y: vec4f,
    moved_x: vec4f,
    moved_y: vec4f,
}

// The vertex that comes next along a loop, and t of the edge to it.
struct MapWalk {
    here: vec4f,
    ray: Ray,
    before: vec4f,
}

// Adds the vertices from `first` to below `end` of a loop.
fn add_map_vertices(
    sums: ptr<function, MapSums>,
    walk: ptr<function, MapWalk>,
    base_x: vec4f,
    base_y: vec4f,
    px: vec4f,
    py: vec4f,
    range: vec2u,
    first: u32,
    end: u32,
) {
    for (var i = first; i < end; i++) {
        let here = (*walk).here;
        let there = corner(select(i + 1u, range.x, i + 1u == range.y));
        let b = ray(there.x - px, there.y - py);
        let after = half_tangent((*walk).ray, b, there.xy - here.xy);
        let w = ((*walk).before + after) * (*walk).ray.inverse;
        (*sums).weight += w;
        (*sums).moment_x += w * here.x;
        (*sums).moment_y += w * here.y;
        (*sums).moved_x += w * (here.z - base_x);
        (*sums).moved_y += w * (here.w - base_y);
        (*walk).here = there;
        (*walk).ray = b;
        (*walk).before = after;
    }
}

// Without derivatives nothing has to be scaled, for coordinates are ratios of the weights.
fn mean_value_map(px: vec4f, py: vec4f, loops: u32, far: f32) -> Moved {
    // Displacements relative to that of the nearest vertex, as the other form has them.
    var nearest = vec4u(0u);
    var least = vec4f(1e30);
    for (var l = 0u; l < loops; l++) {
        let range = ring(l);
        for (var i = range.x; i < range.y; i++) {
            let v = corner(i);
            let x = v.x - px;
            let y = v.y - py;
            let square = x * x + y * y;
            let closer = square < least;
            least = select(least, square, closer);
            nearest = select(nearest, vec4u(i), closer);
        }
    }
    let qx = corner(nearest.x);
    let qy = corner(nearest.y);
    let qz = corner(nearest.z);
    let qw = corner(nearest.w);
    let base_x = vec4f(qx.z, qy.z, qz.z, qw.z);
    let base_y = vec4f(qx.w, qy.w, qz.w, qw.w);
    var sums: MapSums;
    for (var l = 0u; l < loops; l++) {
        let range = ring(l);
        let last = corner(range.y - 1u);
        let first = corner(range.x);
        let a = ray(last.x - px, last.y - py);
        let b = ray(first.x - px, first.y - py);
        var walk = MapWalk(first, b, half_tangent(a, b, first.xy - last.xy));
        if BLOCKED {
            for (var start = range.x; start < range.y; start += BLOCK) {
                var block = MapSums();
                add_map_vertices(&block, &walk, base_x, base_y, px, py, range, start, min(start + BLOCK, range.y));
                sums.weight += block.weight;
                sums.moment_x += block.moment_x;
                sums.moment_y += block.moment_y;
                sums.moved_x += block.moved_x;
                sums.moved_y += block.moved_y;
            }
        } else {
            add_map_vertices(&sums, &walk, base_x, base_y, px, py, range, range.x, range.y);
        }
    }
    let square = px * px + py * py;
    let away = square > vec4f(far);
    let moment = sums.moment_x * px + sums.moment_y * py;
    let inverse = select(vec4f(1.0), square, away) / select(sums.weight, moment, away);
    return Moved(base_x + sums.moved_x * inverse, base_y + sums.moved_y * inverse, nearest, least);
}
