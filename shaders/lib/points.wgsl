// Where the kernels of a map find their points.

// 0 where points are three words (surface::PackedPoint). 1 where they are records of four, the last
// of which is the place of the point's image.
override RECORDS: u32 = 0u;

// The first word of point `index`.
fn point_word(index: u32) -> u32 {
    return index * select(3u, 4u, RECORDS == 1u);
}
