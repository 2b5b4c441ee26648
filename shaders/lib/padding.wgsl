// What both kernels of padding share. Twin of the struct:
// tools::transfer::gpu::pad_seams::PadParams.

//#import lib/none

struct PadParams {
    width: u32,
    height: u32,
    // Pairs of texels in a row.
    pairs: u32,
    // First row.
    first: u32,
    // Largest distance within a column, in texels.
    column_reach: u32,
    // Columns to either side that are looked at.
    row_reach: u32,
    // Largest distance, squared.
    square: u32,
    unused: u32,
}

// No covered texel near: more than any distance in a picture.
const FAR: i32 = 32767;

fn packed(left: i32, right: i32) -> u32 {
    return (bitcast<u32>(left) & 0xffffu) | (bitcast<u32>(right) << 16u);
}

fn unpacked(word: u32) -> vec2i {
    return vec2i(bitcast<i32>(word << 16u) >> 16u, bitcast<i32>(word) >> 16u);
}
