// Which picture a triangle of the source shows.

//#import lib/none
//#import lib/table

// Whether `face`, NONE for no triangle, shows picture `texture`. `textures` has the picture of each
// triangle, four to a texel.
fn shows_picture(textures: texture_2d<u32>, face: u32, texture: u32) -> bool {
    let any = face != NONE;
    let four = texel(textures, select(0u, face / 4u, any));
    return any && four[face % 4u] == texture;
}
