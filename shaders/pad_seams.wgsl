// The nearest covered texel, the lowest on ties, from the nearest ones of the columns around.
// Exact: integers only. Reference and explanation: tools::transfer::pad::pad_seams.

//#import lib/span
//#import lib/padding

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: PadParams;
// What pad_columns wrote.
@group(0) @binding(2) var<storage, read> columns: array<u32>;
// Indices of the nearest texels, of two texels beside one another.
@group(0) @binding(3) var<storage, read_write> nearest: array<vec2u>;

// Squared distance and index of the best texel so far.
struct Best {
    square: u32,
    index: u32,
}

fn better(best: Best, x: u32, y: u32, to_x: u32, dy: i32) -> Best {
    let dx = i32(to_x) - i32(x);
    let square = u32(dx * dx + dy * dy);
    let index = u32(i32(y) + dy) * params.width + to_x;
    let take = dy != FAR && (square < best.square || (square == best.square && index < best.index));
    return Best(select(best.square, square, take), select(best.index, index, take));
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let pair = index % params.pairs;
    let x = 2u * pair;
    let y = params.first + index / params.pairs;
    let here = unpacked(columns[index]);
    let none = Best(params.square + 1u, 0u);
    var a = better(better(none, x, y, x, here.x), x, y, x + 1u, here.y);
    var b = better(better(none, x + 1u, y, x, here.x), x + 1u, y, x + 1u, here.y);
    // Pairs k to the left and right are 2 k - 1 columns away at least.
    let most = params.row_reach / 2u + 1u;
    for (var k = 1u; k <= most; k++) {
        let reach = 2u * k - 1u;
        if reach * reach > max(a.square, b.square) {
            break;
        }
        if k <= pair {
            let d = unpacked(columns[index - k]);
            let at = x - 2u * k;
            a = better(better(a, x, y, at, d.x), x, y, at + 1u, d.y);
            b = better(better(b, x + 1u, y, at, d.x), x + 1u, y, at + 1u, d.y);
        }
        if pair + k < params.pairs {
            let d = unpacked(columns[index + k]);
            let at = x + 2u * k;
            a = better(better(a, x, y, at, d.x), x, y, at + 1u, d.y);
            b = better(better(b, x + 1u, y, at, d.x), x + 1u, y, at + 1u, d.y);
        }
    }
    nearest[index] = select(vec2u(NONE), vec2u(a.index, b.index), vec2u(a.square, b.square) <= vec2u(params.square));
}
