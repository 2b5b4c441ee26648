// F of a ring (equation 13). The form and its reasons are explained at the reference,
// encoding::decode.
//
// The kernel that imports this declares
//   fn position(v: u32) -> vec3f   vertex v
//   fn slot(k: u32) -> Slot        slot k

//#import lib/derivative

// Square of the part of a ring's radius that is added to distances; decode::REGULARISATION.
const REGULAR: f32 = 1e-6;

// Above this a length is no number any more.
const HUGE: f32 = 1e30;

// A neighbour of a row and its coefficients.
struct Slot {
    neighbour: u32,
    w: f32,
    b: f32,
}

// What all terms of F share, relative to the ring's first vertex.
struct Frame {
    origin: vec3f,
    normal: vec3f,
    inverse_length: f32,
    centre: vec3f,
    mean: vec3f,
    regular: f32,
}

// From a ring vertex to the weighted mean: the part along the normal, the part in the plane and its
// regularised length.
struct Offset {
    along: f32,
    plane: vec3f,
    length: f32,
}

fn slot_of(texel: vec4u) -> Slot {
    return Slot(texel.x, bitcast<f32>(texel.z), bitcast<f32>(texel.w));
}

// `at` is the number of the shape's first vertex.
fn ring_frame(row: Row, at: u32) -> Frame {
    let end = row.first + row.count;
    let origin = position(at + slot(row.first).neighbour);
    var before = position(at + slot(end - 1u).neighbour) - origin;
    var area = vec3f();
    var centre = vec3f();
    var mean = vec3f();
    var square = 0.0;
    for (var k = row.first; k < end; k++) {
        let s = slot(k);
        let p = position(at + s.neighbour) - origin;
        area += cross(p, before);
        centre += s.w * p;
        mean += p;
        square += dot(p, p);
        before = p;
    }
    let inverse = 1.0 / f32(row.count);
    mean *= inverse;
    let spread = max(square * inverse - dot(mean, mean), 0.0);
    let size = length(area);
    var inverse_length = 0.0;
    if size > 0.0 && size < HUGE {
        inverse_length = 1.0 / size;
    }
    return Frame(origin, area * inverse_length, inverse_length, centre, mean, REGULAR * spread);
}

fn ring_offset(f: Frame, p: vec3f) -> Offset {
    let r = f.centre - p;
    let along = dot(f.normal, r);
    let plane = r - along * f.normal;
    return Offset(along, plane, sqrt(dot(plane, plane) + f.regular));
}

fn ring_value(row: Row, at: u32) -> vec3f {
    let f = ring_frame(row, at);
    var sum = 0.0;
    for (var k = row.first; k < row.first + row.count; k++) {
        let s = slot(k);
        sum += s.w * s.b * ring_offset(f, position(at + s.neighbour) - f.origin).length;
    }
    return f.origin + (f.centre + sum * f.normal);
}
