// Where the pixels of some rows look: the pre-image of each by the polynomial of the square that it
// lies in. Reference and explanations: mapping::plane::patches (find, solve),
// tools::warp::sight::Sight::preimages.
//
// One workgroup a tile of 8 x 8 pixels, which has a list of squares; span.place is the first row. A
// square is told by whole numbers and parts, so that single precision has displacements only:
// pixels from the image of its centre, pre-images from the texel of its centre.

//#import lib/span
//#import lib/table
//#import lib/place

// Twin: tools::warp::gpu::place::PlaceParams.
struct PlaceParams {
    // Sides of the result and of the picture.
    width: u32,
    height: u32,
    picture_width: u32,
    picture_height: u32,
    // Tiles of a row.
    across: u32,
    // Rows at most.
    rows: u32,
    // 1 if only what the target polygon covers is shown.
    caged: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: PlaceParams;
// Of each run of 32 pixels, row by row: 0 and 1 where the polygon covers none or all of it, else 2
// and where the shares of its pixels are, behind these words.
@group(0) @binding(2) var<storage, read> cage: array<u32>;
@group(0) @binding(3) var<storage, read_write> places: array<PlaceRecord>;
@group(0) @binding(4) var<storage, read_write> shares: array<vec2f>;
// mapping::plane::patches::packed: records, and starts and entries of the tiles, four to a texel.
@group(0) @binding(5) var patches: texture_2d<u32>;
@group(0) @binding(6) var tiles: texture_2d<u32>;

// mapping::plane::patches::packed
const PATCH_TEXELS: u32 = 13u;
const TILE_SIDE: u32 = 8u;
// tools::warp::gpu::place::RUN
const RUN: u32 = 32u;
// mapping::plane::patches::fit
const BENDS: u32 = 18u;
const MARGIN: f32 = 0.03;
// mapping::plane::patches::solve
const SETTLED: f32 = 2e-5;
const CORRECTIONS: u32 = 8u;
const NEAR: f32 = 1.5;

fn tile_word(index: u32) -> u32 {
    let four = texel(tiles, index / 4u);
    return four[index % 4u];
}

// A row of terms in u with its derivative.
struct Row {
    value: vec2f,
    slope: vec2f,
}

fn row_4(u: f32, a: vec2f, b: vec2f, c: vec2f, d: vec2f) -> Row {
    let first = d * u + c;
    let second = first * u + b;
    return Row(second * u + a, (d * u + first) * u + second);
}

fn row_3(u: f32, a: vec2f, b: vec2f, c: vec2f) -> Row {
    let first = c * u + b;
    return Row(first * u + a, c * u + first);
}

// What bends the square: values, derivatives by u and by v.
struct Bend {
    value: vec2f,
    by_u: vec2f,
    by_v: vec2f,
}

fn bend(c: ptr<function, array<vec2f, BENDS>>, u: f32, v: f32) -> Bend {
    let a = row_4(u, (*c)[0], (*c)[1], (*c)[2], (*c)[3]);
    let b = row_4(u, (*c)[4], (*c)[5], (*c)[6], (*c)[7]);
    // The rows of v^0 and v^1 begin with u^2 and u^1.
    let r0 = Row(a.value * u * u, (a.slope * u + a.value + a.value) * u);
    let r1 = Row(b.value * u, b.slope * u + b.value);
    let r2 = row_4(u, (*c)[8], (*c)[9], (*c)[10], (*c)[11]);
    let r3 = row_3(u, (*c)[12], (*c)[13], (*c)[14]);
    let r4 = Row((*c)[16] * u + (*c)[15], (*c)[16]);
    // Horner's scheme in v, from the row of v^5, which is a number.
    var value = (*c)[17];
    var by_v = value;
    value = value * v + r4.value;
    var by_u = r4.slope;
    by_v = by_v * v + value;
    value = value * v + r3.value;
    by_u = by_u * v + r3.slope;
    by_v = by_v * v + value;
    value = value * v + r2.value;
    by_u = by_u * v + r2.slope;
    by_v = by_v * v + value;
    value = value * v + r1.value;
    by_u = by_u * v + r1.slope;
    by_v = by_v * v + value;
    value = value * v + r0.value;
    by_u = by_u * v + r0.slope;
    return Bend(value, by_u, by_v);
}

// How much of a pixel sees the picture, by its distances from two sides of it.
fn seen_between(near: f32, far: f32, dx: f32, dy: f32) -> f32 {
    let most = 0.5 * (abs(dx) + abs(dy));
    let gradient = max(sqrt(dx * dx + dy * dy), 1e-9);
    let part = clamp(0.5 + near / gradient, 0.0, 1.0) * clamp(0.5 + far / gradient, 0.0, 1.0);
    return select(part, 1.0, near >= most && far >= most);
}

// The share of the polygon in pixel x of a row of this dispatch.
fn caged_share(x: u32, y: u32) -> f32 {
    let word = cage[y * ((params.width + RUN - 1u) / RUN) + x / RUN];
    if word < 2u {
        return f32(word);
    }
    return bitcast<f32>(cage[word - 2u + x % RUN]);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let item = span.first + invocation(span, id);
    if item >= span.end {
        return;
    }
    let lane = item % (TILE_SIDE * TILE_SIDE);
    let block = item / (TILE_SIDE * TILE_SIDE);
    let x = (block % params.across) * TILE_SIDE + lane % TILE_SIDE;
    let row = (block / params.across) * TILE_SIDE + lane / TILE_SIDE;
    let y = span.place + row;
    if x >= params.width || row >= params.rows || y >= params.height {
        return;
    }
    let tile = (y / TILE_SIDE) * params.across + x / TILE_SIDE;
    let pixel = vec2i(i32(x), i32(y));
    var share = 1.0;
    if params.caged == 1u {
        share = caged_share(x, row);
    }
    var place: PlaceRecord;
    var seen = UNMAPPED;
    var found = share <= 0.0;
    let start = tile_word(tile);
    // The later of two squares is taken.
    for (var k = tile_word(tile + 1u); k > start && !found; k--) {
        let record = PATCH_TEXELS * tile_word(k - 1u);
        let t0 = texel(patches, record);
        let t1 = texel(patches, record + 1u);
        let inverse = texel_f32(patches, record + 2u);
        let size = texel_f32(patches, record + 3u);
        var terms: array<vec2f, BENDS>;
        for (var i = 0u; i < BENDS / 2u; i++) {
            let two = texel_f32(patches, record + 4u + i);
            terms[2u * i] = two.xy;
            terms[2u * i + 1u] = two.zw;
        }
        let q = vec2f(pixel - bitcast<vec2i>(t1.xy)) + (0.5 - bitcast<vec2f>(t1.zw));
        let goal = vec2f(inverse.x * q.x + inverse.y * q.y, inverse.z * q.x + inverse.w * q.y);
        let reach = 1.0 + MARGIN + size.yz;
        let inside = abs(goal.x) <= reach.x && abs(goal.y) <= reach.y;
        var at = clamp(goal, vec2f(-NEAR), vec2f(NEAR));
        var correction = 3.4e38;
        // I + g', row by row.
        var jacobian = vec4f(1.0, 0.0, 0.0, 1.0);
        var determinant = 1.0;
        for (var turn = 0u; turn < CORRECTIONS && inside && correction > SETTLED; turn++) {
            let g = bend(&terms, at.x, at.y);
            let off = at + g.value - goal;
            jacobian = vec4f(1.0 + g.by_u.x, g.by_v.x, g.by_u.y, 1.0 + g.by_v.y);
            determinant = 1.0 / (jacobian.x * jacobian.w - jacobian.y * jacobian.z);
            let by = vec2f(jacobian.w * off.x - jacobian.y * off.y, jacobian.x * off.y - jacobian.z * off.x) * determinant;
            at = clamp(at - by, vec2f(-NEAR), vec2f(NEAR));
            correction = max(abs(by.x), abs(by.y));
        }
        found = correction <= SETTLED && max(abs(at.x), abs(at.y)) <= 1.0 + MARGIN;
        if found {
            let half = size.x;
            let off = bitcast<vec2f>(t0.zw) + half * at;
            let down = floor(off);
            place.whole = bitcast<vec2i>(t0.xy) + vec2i(down);
            place.part = off - down;
            // The inverse of I + g' times that of the linear part.
            let unit = half * determinant;
            place.dx = unit * vec2f(
                jacobian.w * inverse.x - jacobian.y * inverse.z,
                jacobian.x * inverse.z - jacobian.z * inverse.x,
            );
            place.dy = unit * vec2f(
                jacobian.w * inverse.y - jacobian.y * inverse.w,
                jacobian.x * inverse.w - jacobian.z * inverse.y,
            );
            let near = vec2f(place.whole) + place.part;
            let far = vec2f(vec2i(i32(params.picture_width), i32(params.picture_height)) - place.whole) - place.part;
            let both = seen_between(near.x, far.x, place.dx.x, place.dy.x)
                * seen_between(near.y, far.y, place.dx.y, place.dy.y);
            seen = select(0.0, min(share, both), both > 0.0);
        }
    }
    let index = row * params.width + x;
    places[index] = place;
    shares[index] = vec2f(seen, share);
}
