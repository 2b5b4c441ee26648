// Samples of a stored picture as numbers to average. Reference: tools::transfer::mip::Encoding.

//#import lib/table

// What the words of the picture are: 0 numbers, 1 sRGB numbers that are read as light, 2 bits of
// floats.
override WORDS: u32 = 0u;

fn light_of(light: texture_2d<u32>, word: u32) -> f32 {
    let four = texel_f32(light, word >> 2u);
    return four[word & 3u];
}

// The texel with these words: a sample of 1 has the value `scale`; colours are multiplied by the
// last of 2 or 4 channels where `opacity` is 1. `light` has the light of samples.
fn decoded(light: texture_2d<u32>, word: vec4u, channels: u32, opacity: u32, scale: f32) -> vec4f {
    var value: vec4f;
    if WORDS == 2u {
        value = bitcast<vec4f>(word);
    } else {
        value = vec4f(word) * scale;
    }
    let alpha = select(value.w, value.y, channels == 2u);
    if WORDS == 1u {
        value = vec4f(
            light_of(light, word.x),
            light_of(light, word.y),
            light_of(light, word.z),
            light_of(light, word.w),
        );
    }
    if opacity == 1u {
        value *= alpha;
    }
    if channels == 2u {
        value.y = alpha;
    }
    if channels == 4u {
        value.w = alpha;
    }
    return value;
}
