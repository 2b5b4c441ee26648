// Weights of windowed sincs. Reference: picture::lanczos.

fn sine_pi(x: f32) -> f32 {
    let q = x * x;
    return x * (3.1415927 + q * (-5.167713 + q * (2.550164 + q * (-0.5992645 + q * (0.08214589 - q * 0.007370431)))));
}

fn cosine_pi(x: f32) -> f32 {
    let q = x * x;
    return 1.0 + q * (-4.9348022 + q * (4.058712 + q * (-1.3352628 + q * 0.23533063)));
}

// Weights of the texels -2, -1, 0 and 1, 2, 3.
struct Weights {
    before: vec3f,
    after: vec3f,
}

// Of six texels, three to either side of a point `position` right of the last before it.
fn lanczos_weights_6(position: f32) -> Weights {
    let mirrored = position > 0.5;
    var f = position;
    if mirrored {
        f = 1.0 - position;
    }
    var w: Weights;
    if f < 1e-9 {
        w.before = vec3f(0.0, 0.0, 1.0);
        w.after = vec3f(0.0);
    } else {
        let s1 = sine_pi(f);
        let s = sine_pi(f * (1.0 / 3.0));
        let c = cosine_pi(f * (1.0 / 3.0));
        let a = 0.5 * s;
        let b = 0.8660254 * c;
        let sines = vec3f(b - a, -(a + b), s);
        let before = vec3f(f + 2.0, f + 1.0, f);
        let after = vec3f(f - 1.0, f - 2.0, f - 3.0);
        w.before = s1 * sines / (before * before);
        w.after = s1 * sines / (after * after);
        let share = 1.0 / (w.before.x + w.before.y + w.before.z + w.after.x + w.after.y + w.after.z);
        w.before *= share;
        w.after *= share;
    }
    if mirrored {
        let before = w.before;
        w.before = w.after.zyx;
        w.after = before.zyx;
    }
    return w;
}

// cos and sin of m pi / 4 for the texels m = 3 ... -4 to the left.
const COSINES_8 = array<f32, 8>(-0.70710677, 0.0, 0.70710677, 1.0, 0.70710677, 0.0, -0.70710677, -1.0);
const SINES_8 = array<f32, 8>(0.70710677, 1.0, 0.70710677, 0.0, -0.70710677, -1.0, -0.70710677, 0.0);

// Of eight texels, four to either side.
fn lanczos_weights_8(position: f32) -> array<f32, 8> {
    let mirrored = position > 0.5;
    let f = select(position, 1.0 - position, mirrored);
    var w = array<f32, 8>();
    if f < 1e-9 {
        w[select(3u, 4u, mirrored)] = 1.0;
        return w;
    }
    let s1 = sine_pi(f);
    let s = sine_pi(f * 0.25);
    let c = cosine_pi(f * 0.25);
    var cosines = COSINES_8;
    var sines = SINES_8;
    var sum = 0.0;
    for (var k = 0u; k < 8u; k++) {
        // The texel lies m to the left of the point and f more.
        let m = 3 - i32(k);
        let x = f + f32(m);
        let sign = select(-s1, s1, (m & 1) == 0);
        let weight = sign * (s * cosines[k] + c * sines[k]) / (x * x);
        w[select(k, 7u - k, mirrored)] = weight;
        sum += weight;
    }
    for (var k = 0u; k < 8u; k++) {
        w[k] /= sum;
    }
    return w;
}
