// Where a pixel looks. Twin: tools::warp::gpu::place::PlaceRecord.
struct PlaceRecord {
    // The texel of the picture that holds the pre-image of the pixel's centre, and where in it.
    whole: vec2i,
    part: vec2f,
    // How the pre-image moves when the pixel moves one to the right, and one down.
    dx: vec2f,
    dy: vec2f,
}

// Shares of the pixel, held by twos: of its colour in the result, and of the target polygon. The
// first is negative where the pixel has no pre-image; tools::warp::gpu::place::UNMAPPED.
const UNMAPPED: f32 = -1.0;
