// Where the kernels of a map find their points and keep their vectors.

// 0 where points are an array of their own (surface::PackedPoint) and vectors lie beside them. 1
// where they are the texels of an atlas (four words, the first three a point), of which a dispatch
// takes a part: vectors then begin with the dispatch.
override TEXELS: u32 = 0u;

// The first word of point `index`.
fn point_word(index: u32) -> u32 {
    return index * select(3u, 4u, TEXELS == 1u);
}

// The place of what belongs to point `index` of a dispatch that begins at `first`.
fn own_place(index: u32, first: u32) -> u32 {
    return select(index, index - first, TEXELS == 1u);
}
