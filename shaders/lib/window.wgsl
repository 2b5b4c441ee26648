// Rows of a picture whose texels are on the device. Twin:
// tools::transfer::gpu::window::WindowParams.

struct WindowParams {
    // Texels of a row, and rows of the picture.
    width: u32,
    height: u32,
    // Rows that `texels` and `images` hold: row y is at place y % rows.
    rows: u32,
    unused: u32,
}

// The place of row `y` of the picture among those on the device.
fn kept_row(params: WindowParams, y: u32) -> u32 {
    return y % params.rows;
}
