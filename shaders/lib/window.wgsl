// Rows of a picture whose texels are on the device. Twin: tools::transfer::gpu::window::WindowParams.

struct WindowParams {
    // Texels of a row, and rows of the picture.
    width: u32,
    height: u32,
    // Rows that `texels` and `images` hold: row y is at place y % rows.
    rows: u32,
    unused: u32,
}

// The place of the texel of an invocation among those on the device.
fn texel_place(span: Span, params: WindowParams, id: vec3u) -> u32 {
    let row = span.place + id.y;
    return select(row, row - params.rows, row >= params.rows) * params.width + id.x;
}
