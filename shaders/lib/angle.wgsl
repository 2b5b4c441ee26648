// Angles from sine and cosine by a polynomial. Reference: mapping::space::angle.

const PI: f32 = 3.14159265358979;
// tan(pi / 8).
const SPLIT: f32 = 0.41421356237309503;
// Denominators are at least this.
const LEAST: f32 = 1e-37;

// The angle in 0..pi whose sine and cosine are in the ratio y to x, y not negative.
fn angle(y: f32, x: f32) -> f32 {
    let across = abs(x);
    let steep = across < y;
    let small = select(y, across, steep);
    let large = select(across, y, steep);
    let wide = large * SPLIT < small;
    let over = select(small, small - large, wide);
    let under = max(select(large, small + large, wide), LEAST);
    let a = over / under;
    let s = a * a;
    let p = ((8.05374449538e-2 * s - 1.38776856032e-1) * s + 1.99777106478e-1) * s - 3.33329491539e-1;
    var r = a + a * s * p + select(0.0, 0.25 * PI, wide);
    r = select(r, 0.5 * PI - r, steep);
    return select(r, PI - r, x < 0.0);
}
