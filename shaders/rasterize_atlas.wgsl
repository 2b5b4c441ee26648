// Which point of the target each texel of its texture shows. Decisions are made in integers and are
// those of the reference, tools::transfer::atlas::rasterize_atlas, where they are explained.

//#import lib/span
//#import lib/atlas

// Twin: tools::transfer::gpu::rasterize_atlas::RasterizeParams.
struct RasterizeParams {
    // Column and row of the tile's first texel, texels of its rows.
    x: u32,
    y: u32,
    width: u32,
    // Column and row of the first bin, bins of a row of bins.
    first_x: u32,
    first_y: u32,
    columns: u32,
    // Entries of a bin beyond which it is left to the reference.
    most: u32,
    // Where the tile's first texel goes among `texels`; NONE where a dispatch begins at the first.
    place: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: RasterizeParams;
// First entry of each bin.
@group(0) @binding(2) var<storage, read> starts: array<u32>;
// atlas::AtlasTexel.
@group(0) @binding(3) var<storage, read_write> texels: array<vec4u>;
@group(0) @binding(4) var entries: texture_2d<u32>;
@group(0) @binding(5) var triangles: texture_2d<u32>;

// atlas::AtlasTexel.
const CENTRE: u32 = 1u;
const FOOTPRINT: u32 = 2u;
const OVERLAP: u32 = 4u;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let number = invocation(span, id);
    let index = span.first + number;
    if index >= span.end {
        return;
    }
    let x = params.x + index % params.width;
    let y = params.y + index / params.width;
    let bin = (y / BIN - params.first_y) * params.columns + x / BIN - params.first_x;
    let first = starts[bin];
    var end = starts[bin + 1u];
    if end - first > params.most {
        end = first;
    }
    let i = i32(x % BIN);
    let j = i32(y % BIN);
    let centre = vec2i(i32(x), i32(y)) * SUBTEXEL + SUBTEXEL / 2;

    var texel_found = vec4u(NONE, 0u, 0u, 0u);
    // Software devices run both sides of a branch, loops only as long as some lane is in them: so
    // what is rare stands in a loop, and what is done once behind it.
    var cover = 0u;
    var holder = first;
    for (var k = first; k < end; k++) {
        let e = bin_entry(entries, k);
        if holds_centre(e, atlas_corners(triangles, e.triangle), i, j) {
            if cover != 0u {
                cover |= OVERLAP;
                break;
            }
            cover = CENTRE;
            holder = k;
        }
    }
    var start = first;
    if cover != 0u {
        start = holder;
        let e = bin_entry(entries, holder);
        let g = texel_f32(triangles, 3u * e.triangle + 2u);
        let b = e.barycentric + f32(i) * g.xz + f32(j) * g.yw;
        texel_found = vec4u(e.face, bitcast<vec2u>(b), cover);
        // Inside: no need to look on.
        end = select(holder + 1u, holder, b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0);
    }
    // Without a holder: the closest of those that touch the texel's square. With one that snapping
    // moved over the centre, by at most 1/256 texel: its own boundary.
    var best = 3.4e38;
    for (var k = start; k < end; k++) {
        let e = bin_entry(entries, k);
        let t = atlas_corners(triangles, e.triangle);
        if cover != 0u || touches_square(e, t, i, j, centre) {
            let nearest = closest_on_boundary(t, centre);
            if nearest.distance < best {
                best = nearest.distance;
                texel_found =
                    vec4u(e.face, bitcast<vec2u>(nearest.barycentric.xy), select(cover, FOOTPRINT, cover == 0u));
            }
        }
    }
    texels[select(params.place + index, number, params.place == NONE)] = texel_found;
}
