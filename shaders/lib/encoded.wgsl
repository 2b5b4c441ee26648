// Values as samples of a picture. Reference: tools::transfer::color::Sample.

//#import lib/table

// Samples of the result: 0 of 8 bits, 1 of 16 bits, 2 floats.
override DEPTH: u32 = 0u;
// 1 where colours are light and samples sRGB.
override LIGHT: u32 = 0u;

// The largest sample of integers.
fn full() -> u32 {
    return select(255u, 65535u, DEPTH == 1u);
}

// The sample of the value 1.
fn sample_of_one() -> u32 {
    return select(full(), bitcast<u32>(1.0), DEPTH == 2u);
}

// The nearest sample to a value.
fn sample_of(value: f32) -> u32 {
    if DEPTH == 2u {
        return bitcast<u32>(value);
    }
    let most = f32(full());
    // What is no number is not above 0.
    return u32(clamp(select(0.0, value * most + 0.5, value > 0.0), 0.0, most));
}

// The same of light: the number of steps below it. `steps` has the light from which on a sample is
// larger, four to a texel.
fn sample_of_light(steps: texture_2d<u32>, value: f32) -> u32 {
    if DEPTH == 2u || LIGHT == 0u {
        return sample_of(value);
    }
    var low = 0u;
    var high = full();
    // One bit of the sample a turn.
    for (var turn = 0u; turn < 16u && low < high; turn++) {
        let middle = (low + high + 1u) / 2u;
        let step = texel_f32(steps, (middle - 1u) / 4u)[(middle - 1u) % 4u];
        let reached = value >= step;
        low = select(low, middle, reached);
        high = select(middle - 1u, high, reached);
    }
    return low;
}

// The words of a texel of `wide` samples; samples beyond them are not read.
fn packed_samples(samples: vec4u, wide: u32) -> vec4u {
    let four = select(vec4u(0u), samples, vec4u(0u, 1u, 2u, 3u) < vec4u(wide));
    if DEPTH == 0u {
        return vec4u(four.x | (four.y << 8u) | (four.z << 16u) | (four.w << 24u), 0u, 0u, 0u);
    }
    if DEPTH == 1u {
        return vec4u(four.x | (four.y << 16u), four.z | (four.w << 16u), 0u, 0u);
    }
    return samples;
}
