// The nearest covered texel in the column of each texel, by bits of the coverage that stand 32 rows
// to a word. Reference: tools::transfer::pad::nearest_in_columns.

//#import lib/span
//#import lib/padding

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: PadParams;
// Word (y / 32) * width + x holds rows of column x, the lowest bit first.
@group(0) @binding(2) var<storage, read> bits: array<u32>;
// Row distances of two texels beside one another, 16 bits each; from row `params.first` on.
@group(0) @binding(3) var<storage, read_write> columns: array<u32>;

fn word_at(x: u32, row: u32) -> u32 {
    return bits[row * params.width + x];
}

// Distance to the nearest covered texel at or above; FAR if there is none within the margin.
fn above(x: u32, y: u32) -> i32 {
    var row = y / 32u;
    var word = word_at(x, row) & (0xffffffffu >> (31u - y % 32u));
    let most = min(row, params.column_reach / 32u + 1u);
    for (var k = 0u; k < most && word == 0u; k++) {
        row -= 1u;
        word = word_at(x, row);
    }
    let distance = i32(y) - i32(row * 32u + 31u - countLeadingZeros(word));
    return select(FAR, distance, word != 0u && distance <= i32(params.column_reach));
}

fn below(x: u32, y: u32) -> i32 {
    var row = y / 32u;
    var word = word_at(x, row) & (0xffffffffu << (y % 32u));
    let most = min((params.height - 1u) / 32u - row, params.column_reach / 32u + 1u);
    for (var k = 0u; k < most && word == 0u; k++) {
        row += 1u;
        word = word_at(x, row);
    }
    let distance = i32(row * 32u + countTrailingZeros(word)) - i32(y);
    return select(FAR, distance, word != 0u && distance <= i32(params.column_reach));
}

// Negative upwards, which is taken on ties.
fn nearest(x: u32, y: u32) -> i32 {
    if x >= params.width {
        return FAR;
    }
    let up = above(x, y);
    let down = below(x, y);
    return select(down, -up, up <= down && up != FAR);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let x = 2u * (index % params.pairs);
    let y = params.first + index / params.pairs;
    columns[index] = packed(nearest(x, y), nearest(x + 1u, y));
}
