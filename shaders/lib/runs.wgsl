// Texels of runs: eight neighbours in a row of the picture, which begin at a multiple of eight.
// Only bins with triangles have runs, so that no lane works on the empty parts of an atlas. Twin:
// tools::transfer::gpu::runs.

// runs::RUN_BITS: a run has two to the power of this.
const RUN_BITS: u32 = 3u;

// Column and row of texel `index` of the list, whose run is `word`. The column may be beyond the
// row.
fn run_texel(word: u32, index: u32) -> vec2u {
    return vec2u(((word & 0xffffu) << RUN_BITS) + (index & ((1u << RUN_BITS) - 1u)), word >> 16u);
}
