// Whether the image of a point can be trusted, from what its projections found, and that image to
// its place. What the projections left is marked, for the reference. Reference and explanation:
// surface::gpu::judge_image.

//#import lib/none
//#import lib/span
//#import lib/image
//#import lib/projected
//#import lib/table

// Twin: surface::gpu::judge_image::JudgeParams.
struct JudgeParams {
    // Mean edge of the source over the square root of its area.
    unit: f32,
    // Where confidence is one half: residual, drift, round trip.
    residual: f32,
    drift: f32,
    round_trip: f32,
    // Confidence below which a point is doubtful, and that of points in turned triangles at most.
    threshold: f32,
    doubt: f32,
    // Squared distance, in edges, beyond which the reference looks at a projection closer.
    guard: f32,
    // Barycentric coordinates may leave the triangle by this much.
    slack: f32,
    // Triangles of the source.
    faces: u32,
    // Whether evidence is gathered, and whether there is a second projection.
    evidence: u32,
    returns: u32,
    // A confidence this close to the threshold may be on either side of it in double precision.
    margin: f32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: JudgeParams;
// A point and the place of its image; no triangle where there is none.
@group(0) @binding(2) var<storage, read> points: array<vec4u>;
// Without a second projection `back` is the first once more.
@group(0) @binding(3) var<storage, read> forward: array<Projected>;
@group(0) @binding(4) var<storage, read> back: array<Projected>;
@group(0) @binding(5) var<storage, read_write> images: array<PackedImage>;
// Of each triangle of the target the drift at its corners, and what is turned over.
@group(0) @binding(6) var vouching: texture_2d<u32>;

// The triangle itself is turned over; the bits above stand for its corners.
const TURNED: u32 = 1u;

fn falling(x: f32, half: f32) -> f32 {
    let r = x / half;
    return 1.0 / (1.0 + r * r);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let point = points[index];
    var image = PackedImage(NONE, 0.0, 0.0, 0.0, FAILED);
    if point.x != NONE {
        let found = forward[index];
        let b = bitcast<vec2f>(point.yz);
        let x = vec3f(b, 1.0 - b.x - b.y);
        let how = found.found & HOW;
        let returned = back[index];
        let how_back = returned.found & HOW;
        var left = how == NOTHING || how == LEFT || !(found.distance_squared <= params.guard);
        left = left || (params.returns == 1u && (how_back == NOTHING || how_back == LEFT));

        let vouch = texel(vouching, point.x);
        var confidence = 1.0;
        if params.evidence == 1u {
            let drift = max(dot(x, bitcast<vec3f>(vouch.xyz)), 0.0);
            let residual = sqrt(found.distance_squared) * params.unit;
            confidence = min(falling(residual, params.residual), falling(drift, params.drift));
            if params.returns == 1u {
                confidence = min(confidence, falling(sqrt(returned.distance_squared), params.round_trip));
            }
        }
        let turned = (vouch.w & TURNED) != 0u || (x.x == 1.0 && (vouch.w & (TURNED << 1u)) != 0u)
            || (x.y == 1.0 && (vouch.w & (TURNED << 2u)) != 0u) || (x.z == 1.0 && (vouch.w & (TURNED << 3u)) != 0u);
        var status = select(DOUBTFUL, VALID, confidence >= params.threshold);
        if turned {
            confidence = min(confidence, params.doubt);
            status = DOUBTFUL;
        }
        // Single precision cannot tell: the reference does.
        left = left || abs(confidence - params.threshold) <= params.margin;
        let rest = 1.0 - found.b0 - found.b1;
        let inside = found.face < params.faces && min(min(found.b0, found.b1), rest) >= -params.slack;
        if left {
            image.status = LEFT_TO_REFERENCE;
        } else if inside {
            image = PackedImage(found.face, found.b0, found.b1, confidence, status);
        }
        images[point.w] = image;
    }
}
