// What became of the texels: the coverage picture, counts, and the area that they stand for on the
// target. Reference and explanation: tools::transfer::tally.

//#import lib/span
//#import lib/image
//#import lib/none
//#import lib/table
//#import lib/window

// Twin: tools::transfer::tally::Sums.
struct Sums {
    covered: u32,
    centre: u32,
    overlapping: u32,
    valid: u32,
    doubtful: u32,
    area: f32,
    valid_area: f32,
    doubtful_area: f32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: WindowParams;
// atlas::AtlasTexel.
@group(0) @binding(2) var<storage, read> texels: array<vec4u>;
@group(0) @binding(3) var<storage, read> images: array<PackedImage>;
// Four texels to a word; rows begin with a word of their own.
@group(0) @binding(4) var<storage, read_write> covers: array<u32>;
// Of each run of a row of the dispatch.
@group(0) @binding(5) var<storage, read_write> sums: array<Sums>;
// tables::TargetTriangle.
@group(0) @binding(6) var target_: texture_2d<u32>;
// Of each triangle of the source whether some layer has a colour there, four to a texel.
@group(0) @binding(7) var colored: texture_2d<u32>;

// tally::WORDS: words of four texels that a lane takes.
const WORDS: u32 = 4u;
// tally::HOLE, and the values of coverage.
const HOLE: u32 = 1u;
const COVER_DOUBTFUL: u32 = 128u;
const COVER_VALID: u32 = 255u;

// atlas::AtlasTexel.
const CENTRE: u32 = 1u;
const OVERLAP: u32 = 4u;

// Counts by two to a word, which no run of 1,024 texels overflows; areas.
var<workgroup> counts: array<vec4u, GROUP>;
var<workgroup> areas: array<vec4f, GROUP>;

@compute @workgroup_size(GROUP)
fn main(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = span.place + id.y;
    let first = select(row, row - params.rows, row >= params.rows) * params.width;
    let stride = (params.width + 3u) / 4u;
    let y = span.first + id.y;
    var count = vec4u();
    var area = vec4f();
    for (var k = 0u; k < WORDS; k++) {
        let word = (group.x * WORDS + k) * GROUP + lane;
        var cover = 0u;
        for (var j = 0u; j < 4u && 4u * word + j < params.width; j++) {
            let shown = texels[first + 4u * word + j];
            if shown.x != NONE {
                let face = images[first + 4u * word + j].face;
                let status = images[first + 4u * word + j].status;
                let any = face != NONE && status != FAILED;
                let has_color = any && texel(colored, select(0u, face / 4u, any))[face % 4u] == 1u;
                let is_centre = (shown.w & CENTRE) != 0u;
                let valid = has_color && status == VALID;
                let doubtful = has_color && status != VALID;
                // A texel seen at its centre stands for its area; the others' is counted by their
                // neighbours.
                let own = select(0.0, bitcast<f32>(texel(target_, shown.x).y), is_centre);
                count.x += 1u + (select(0u, 1u, is_centre) << 16u);
                count.y += select(0u, 1u, (shown.w & OVERLAP) != 0u) + (select(0u, 1u, valid) << 16u);
                count.z += select(0u, 1u, doubtful);
                area += vec4f(own, select(0.0, own, valid), select(0.0, own, doubtful), 0.0);
                let value = select(select(HOLE, COVER_DOUBTFUL, doubtful), COVER_VALID, valid);
                cover |= value << (8u * j);
            }
        }
        if word < stride {
            covers[y * stride + word] = cover;
        }
    }
    counts[lane] = count;
    areas[lane] = area;
    workgroupBarrier();
    if lane == 0u {
        for (var l = 1u; l < GROUP; l++) {
            count += counts[l];
            area += areas[l];
        }
        let runs = (stride + WORDS * GROUP - 1u) / (WORDS * GROUP);
        sums[y * runs + group.x] = Sums(
            count.x & 0xffffu,
            count.x >> 16u,
            count.y & 0xffffu,
            count.y >> 16u,
            count.z,
            area.x,
            area.y,
            area.z,
        );
    }
}
