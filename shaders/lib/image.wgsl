// Where a point of the target went on the source. Twin: surface::packed::PackedImage.

struct PackedImage {
    // Triangle of the source, or NONE.
    face: u32,
    b0: f32,
    b1: f32,
    confidence: f32,
    status: u32,
}

// surface::packed::Status.
const FAILED: u32 = 0u;
const DOUBTFUL: u32 = 1u;
const VALID: u32 = 2u;

// The kernels left the point; surface::packed::LEFT.
const LEFT_TO_REFERENCE: u32 = 3u;
