// The mean value map of four points at once: component k of every vec4f belongs to point k. The form and the reason for each
// of its branches are explained at the reference, mapping::plane::mean_value.
//
// The kernel that imports this declares
//   fn corner(i: u32) -> vec4f   vertex i: position, displacement
//   fn ring(l: u32) -> vec2u     loop l: its first vertex, one past its last; at least two of them

// Squared distance below which a point is at a vertex; mean_value::AT_VERTEX.
const AT_VERTEX: f32 = 1e-30;

// What the first pass over the edges finds: the nearest vertex, its squared distance and displacement; tau and its gradient,
// and the edge that sets it (none where no angle is obtuse).
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

// One end of an edge, seen from the points; `x / square` and `y / square` are the gradient of its direction.
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

// Sums over the vertices; and in the end image minus point and derivative minus identity, row by row.
struct Sums {
    weight: vec4f,
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
    found.widest = vec4u(0xffffffffu);
    // |A| and -D of the widest so far; with these numbers any obtuse angle wins.
    var best_area = vec4f(1.0);
    var best_product = vec4f(0.0);
    var from_x: vec4f;
    var from_y: vec4f;
    var to_x: vec4f;
    var to_y: vec4f;
    var edge_x: vec4f;
    var edge_y: vec4f;
    for (var l = 0u; l < loops; l++) {
        let range = ring(l);
        var here = corner(range.x);
        var ax = here.x - px;
        var ay = here.y - py;
        var a = ax * ax + ay * ay;
        for (var i = range.x; i < range.y; i++) {
            let there = corner(select(i + 1u, range.x, i + 1u == range.y));
            let bx = there.x - px;
            let by = there.y - py;
            let b = bx * bx + by * by;
            let closer = a < found.square;
            found.square = select(found.square, a, closer);
            found.nearest = select(found.nearest, vec4u(i), closer);
            found.base_x = select(found.base_x, vec4f(here.z), closer);
            found.base_y = select(found.base_y, vec4f(here.w), closer);
            let edge = there.xy - here.xy;
            let size = abs(area(ax, ay, a, bx, by, b, vec4f(edge.x), vec4f(edge.y)));
            let product = ax * bx + ay * by;
            // |A / D| falls as an obtuse angle widens; the products compare the quotients.
            let wider = size * best_product + best_area * product < vec4f(0.0);
            best_area = select(best_area, size, wider);
            best_product = select(best_product, -product, wider);
            found.widest = select(found.widest, vec4u(i), wider);
            from_x = select(from_x, ax, wider);
            from_y = select(from_y, ay, wider);
            to_x = select(to_x, bx, wider);
            to_y = select(to_y, by, wider);
            edge_x = select(edge_x, vec4f(edge.x), wider);
            edge_y = select(edge_y, vec4f(edge.y), wider);
            here = there;
            ax = bx;
            ay = by;
            a = b;
        }
    }
    let none = found.widest == vec4u(0xffffffffu);
    let start = ray(from_x, from_y);
    let stop = ray(to_x, to_y);
    let signed = area(from_x, from_y, start.square, to_x, to_y, stop.square, edge_x, edge_y);
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

fn add_vertex(sums: ptr<function, Sums>, found: Scan, scale: vec4f, u: vec2f, at: Ray, before: Half, after: Half) {
    let c = scale * at.inverse;
    let w = c * (before.t + after.t);
    let ux = u.x - found.base_x;
    let uy = u.y - found.base_y;
    let gx = c * (before.x + after.x) + w * at.turn_x;
    let gy = c * (before.y + after.y) + w * at.turn_y;
    (*sums).weight += w;
    (*sums).moved_x += w * ux;
    (*sums).moved_y += w * uy;
    (*sums).weight_x += gx;
    (*sums).weight_y += gy;
    (*sums).xx += ux * gx;
    (*sums).xy += ux * gy;
    (*sums).yx += uy * gx;
    (*sums).yy += uy * gy;
}

fn mean_value(found: Scan, px: vec4f, py: vec4f, loops: u32) -> Sums {
    var sums: Sums;
    let scale = sqrt(found.square);
    for (var l = 0u; l < loops; l++) {
        let range = ring(l);
        // The first vertex of a loop waits for its last edge.
        let first = corner(range.x);
        let first_ray = ray(first.x - px, first.y - py);
        var here = corner(range.x + 1u);
        var a = ray(here.x - px, here.y - py);
        let leaving = half_edge(found, range.x, first_ray, a, here.xy - first.xy);
        var before = leaving;
        for (var i = range.x + 1u; i < range.y; i++) {
            let there = corner(select(i + 1u, range.x, i + 1u == range.y));
            let b = ray(there.x - px, there.y - py);
            let after = half_edge(found, i, a, b, there.xy - here.xy);
            add_vertex(&sums, found, scale, here.zw, a, before, after);
            here = there;
            a = b;
            before = after;
        }
        add_vertex(&sums, found, scale, first.zw, first_ray, before, leaving);
    }
    let inverse = 1.0 / sums.weight;
    let mx = sums.moved_x * inverse;
    let my = sums.moved_y * inverse;
    return Sums(
        sums.weight,
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
