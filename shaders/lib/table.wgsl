// Tables of four-word texels. See engine::device::table.

// Texels of a row; device::table::WIDTH.
const TABLE_WIDTH: u32 = 2048u;

fn texel(table: texture_2d<u32>, index: u32) -> vec4u {
    return textureLoad(table, vec2u(index % TABLE_WIDTH, index / TABLE_WIDTH), 0);
}

fn texel_f32(table: texture_2d<u32>, index: u32) -> vec4f {
    return bitcast<vec4f>(texel(table, index));
}
