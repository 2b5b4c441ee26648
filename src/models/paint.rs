//! The picture on the characters: a colour for each point of the neutral body.
//!
//! Because colours depend on the place on the body alone, they cross the seams of any atlas without
//! a jump, and painting two characters by the same function shows what a perfect transfer looks
//! like.

use glam::{DVec2, DVec3};

/// Width of a painted edge, metres on the neutral body.
const SOFT: f64 = 0.0016;

const SKIN: DVec3 = DVec3::new(0.945, 0.745, 0.604);
const BLUSH: DVec3 = DVec3::new(0.91, 0.56, 0.47);
const HAIR: DVec3 = DVec3::new(0.36, 0.20, 0.13);
const CREAM: DVec3 = DVec3::new(0.975, 0.945, 0.87);
const TEAL: DVec3 = DVec3::new(0.10, 0.48, 0.50);
const NAVY: DVec3 = DVec3::new(0.16, 0.22, 0.38);
const DENIM: DVec3 = DVec3::new(0.27, 0.38, 0.60);
const MUSTARD: DVec3 = DVec3::new(0.93, 0.69, 0.22);
const RED: DVec3 = DVec3::new(0.82, 0.24, 0.20);
const BROWN: DVec3 = DVec3::new(0.33, 0.21, 0.14);
const WHITE: DVec3 = DVec3::new(0.98, 0.98, 0.97);
const INK: DVec3 = DVec3::new(0.09, 0.09, 0.13);

/// 1 inside (negative distance), 0 outside, smooth between.
fn inside(distance: f64) -> f64 {
    let t = (0.5 - distance / SOFT).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn ellipse(p: DVec2, centre: DVec2, radii: DVec2) -> f64 {
    let q = (p - centre) / radii;
    (q.length() - 1.0) * radii.min_element()
}

fn segment(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a + (b - a) * t)
}

fn line(p: DVec2, points: &[(f64, f64)], half_width: f64) -> f64 {
    points.windows(2).map(|w| segment(p, w[0].into(), w[1].into()) - half_width).fold(f64::INFINITY, f64::min)
}

/// Distance to the nearest of equal stripes: negative within the first half of each period.
fn stripes(x: f64, period: f64) -> f64 {
    let t = x.rem_euclid(period);
    (t - 0.25 * period).abs().min((t - 1.25 * period).abs()) - 0.25 * period
}

/// Lays `top()` over `below` where the distance is negative; nothing is computed where it cannot be
/// seen.
fn over(below: DVec3, distance: f64, top: impl FnOnce() -> DVec3) -> DVec3 {
    match inside(distance) {
        0.0 => below,
        1.0 => top(),
        cover => below.lerp(top(), cover),
    }
}

/// The colour (sRGB, 0 to 1) at a point of the neutral body.
pub(super) fn color(p: DVec3) -> DVec3 {
    let x = p.x.abs();
    // From the outermost layer inwards: each computes what is below it only where it leaves it to
    // be seen.
    let body = || over(limbs(p), (-collar(p)).max(0.955 - p.y).max(x - 0.43), || shirt_color(p));
    let dressed = || {
        let trousers = (p.y - 0.965).max(0.105 - p.y).max(x - 0.4);
        match inside(trousers) {
            1.0 => trousers_color(p),
            _ => over(body(), trousers, || trousers_color(p)),
        }
    };
    if inside(1.452 - p.y) == 1.0 {
        return head_color(p);
    }
    if inside(p.y - 0.105) == 1.0 {
        return shoe_color(p);
    }
    let c = over(dressed(), (p.y - 0.962).abs() - 0.022, || belt_color(p));
    let c = over(c, p.y - 0.105, || shoe_color(p));
    over(c, 1.452 - p.y, || head_color(p))
}

/// Distance outside the round neck of the shirt: negative within it.
fn collar(p: DVec3) -> f64 {
    // About the axis of the neck, which leans back; lower in front.
    let around = DVec2::new(p.x, p.z - 0.012).length();
    (around - 0.098).max(1.345 - p.y)
}

fn limbs(p: DVec3) -> DVec3 {
    let mut c = SKIN;
    let x = p.x.abs();
    // Lines between the fingers, and nails at their ends, on both sides of the hand.
    for z in [-0.028, -0.004, 0.02] {
        let d = (p.z - z).abs().max(0.845 - x) - 0.0016;
        c = c.lerp(SKIN * 0.66, 0.9 * inside(d));
    }
    for z in [-0.04, -0.016, 0.008, 0.032] {
        let nail = ellipse(DVec2::new(x, p.z), DVec2::new(0.912, z), DVec2::new(0.011, 0.0065));
        c = c.lerp(DVec3::new(0.99, 0.86, 0.82), inside(nail.max(1.335 - p.y)));
    }
    // A watch on the left wrist, beads on the right one.
    if p.x > 0.0 {
        c = c.lerp(INK, inside((x - 0.715).abs() - 0.014));
        let dial = DVec2::new(x - 0.715, p.z + 0.002).length() - 0.021;
        let top = 1.33 - p.y;
        c = c.lerp(MUSTARD, inside((dial - 0.004).max(top)));
        c = c.lerp(WHITE, inside(dial.max(top)));
        let hands = line(DVec2::new(x - 0.715, p.z + 0.002), &[(0.0, 0.014), (0.0, 0.0), (0.01, 0.0)], 0.0018);
        c = c.lerp(INK, inside(hands.max(top)));
    } else {
        let around = (p.y - 1.343).atan2(p.z);
        let bead = (around * 9.0 / std::f64::consts::TAU).rem_euclid(1.0) - 0.5;
        let which = (around * 9.0 / std::f64::consts::TAU).rem_euclid(9.0) as usize;
        let ball = DVec2::new(x - 0.72, bead * 0.031).length() - 0.0125;
        c = c.lerp([RED, MUSTARD, TEAL][which % 3], inside(ball));
    }
    // Freckles on the forearms.
    speckle(p, c, inside((x - 0.58).abs() - 0.1))
}

/// Freckles: dots at the nodes of a skewed lattice, by their place on the neutral body.
fn speckle(p: DVec3, c: DVec3, amount: f64) -> DVec3 {
    if amount == 0.0 {
        return c;
    }
    let q = p / 0.021;
    let cell = q.floor();
    let hash = (cell.dot(DVec3::new(12.9898, 78.233, 37.719)).sin() * 43758.5453).rem_euclid(1.0);
    let shift = DVec3::new(hash, (hash * 57.0).fract(), (hash * 113.0).fract()) * 0.4 + 0.3;
    let d = ((q - cell - shift).length() - 0.13 - 0.08 * hash) * 0.021;
    c.lerp(DVec3::new(0.78, 0.49, 0.33), 0.75 * amount * inside(d))
}

fn shirt_color(p: DVec3) -> DVec3 {
    let x = p.x.abs();
    let mut c = CREAM.lerp(TEAL, inside(stripes(p.y - 0.985, 0.068)));
    // Sleeves, sewn in along a slanted line, with a cuff.
    c = c.lerp(NAVY, inside(0.158 + 0.75 * (1.33 - p.y).max(0.0) - x));
    c = c.lerp(MUSTARD, inside((x - 0.412).abs() - 0.018));
    c = c.lerp(CREAM, inside((x - 0.375).abs() - 0.006));
    c = c.lerp(NAVY, inside(collar(p).abs() - 0.014));
    // A badge with a letter in front, a number behind.
    let badge = DVec2::new(p.x, p.y - 1.19);
    if p.z > 0.0 {
        let r = badge.length();
        c = c.lerp(NAVY, inside(r - 0.088));
        c = c.lerp(MUSTARD, inside(r - 0.079));
        let b = [
            (-0.026, -0.045),
            (-0.026, 0.045),
            (0.008, 0.045),
            (0.024, 0.036),
            (0.026, 0.022),
            (0.02, 0.008),
            (0.004, 0.002),
            (-0.026, 0.002),
            (0.006, 0.002),
            (0.026, -0.006),
            (0.033, -0.021),
            (0.026, -0.038),
            (0.008, -0.045),
            (-0.026, -0.045),
        ];
        c.lerp(NAVY, inside(line(badge, &b, 0.009)))
    } else {
        let q = DVec2::new(-badge.x, badge.y + 0.01);
        let four = line(
            q + DVec2::new(0.052, 0.0),
            &[(0.018, -0.06), (0.018, 0.06), (-0.036, -0.022), (0.038, -0.022)],
            0.011,
        );
        let two = [
            (-0.028, 0.035),
            (-0.02, 0.053),
            (0.0, 0.06),
            (0.02, 0.053),
            (0.028, 0.034),
            (0.022, 0.012),
            (-0.028, -0.06),
            (0.032, -0.06),
        ];
        let d = four.min(line(q - DVec2::new(0.052, 0.0), &two, 0.011));
        c = c.lerp(CREAM, inside(d - 0.009));
        c.lerp(RED, inside(d))
    }
}

fn trousers_color(p: DVec3) -> DVec3 {
    let x = p.x.abs();
    // A weave too fine to be seen but as texture.
    let weave = (p.y * 700.0 + p.x * 500.0).sin() * (p.x * 700.0 - p.z * 600.0).sin();
    let mut c = DENIM * (1.0 + 0.035 * weave);
    // Side seams with stitches, front fly, pockets, turned-up hems.
    let stitch = inside(stripes(p.y, 0.016));
    let side = (p.z).abs().max(0.14 - x);
    c = c.lerp(NAVY, inside(side - 0.003));
    c = c.lerp(MUSTARD, 0.8 * stitch * inside((side - 0.009).abs() - 0.0015));
    let pocket = DVec2::new(x - 0.18, p.y - 0.95).length() - 0.085;
    if p.z > 0.0 {
        c = c.lerp(NAVY, inside((pocket.abs() - 0.002).max(0.0 - p.z)));
        c = c.lerp(MUSTARD, 0.8 * stitch * inside((pocket + 0.008).abs() - 0.0015));
        c = c.lerp(NAVY, inside((x - 0.002).max(0.85 - p.y)));
        // Knee patches, one plain with a star of stitches, one chequered.
        let q = DVec2::new(x - 0.105, p.y - 0.44);
        let patch = q.abs().max_element() - 0.052;
        let cloth = if p.x > 0.0 {
            MUSTARD.lerp(RED, inside((q.length() - 0.03).abs() - 0.006))
        } else {
            let check = stripes(q.x, 0.035) * stripes(q.y, 0.035);
            RED.lerp(CREAM, inside(check * 400.0 * SOFT / 0.0016))
        };
        c = c.lerp(cloth, inside(patch));
        c = c.lerp(BROWN, inside((patch + 0.004).abs() - 0.0016));
    } else {
        let q = DVec2::new(x - 0.1, p.y - 0.83);
        let back = q.abs().max_element() - 0.048;
        c = c.lerp(NAVY, inside(back.abs() - 0.002));
        c = c.lerp(MUSTARD, inside(line(q, &[(-0.04, 0.01), (0.0, -0.015), (0.04, 0.01)], 0.002)));
    }
    c.lerp(DENIM.lerp(WHITE, 0.45), inside(p.y - 0.15))
}

fn belt_color(p: DVec3) -> DVec3 {
    let mut c = BROWN;
    if p.z > 0.0 {
        let q = DVec2::new(p.x, p.y - 0.962);
        for k in -1..3 {
            c = c.lerp(INK, inside(DVec2::new(q.x - 0.065 - 0.022 * f64::from(k), q.y).length() - 0.004));
        }
        let buckle = (q.x.abs() - 0.03).max(q.y.abs() - 0.027);
        c = c.lerp(MUSTARD, inside(buckle));
        c = c.lerp(BROWN, inside(buckle + 0.008));
        c = c.lerp(MUSTARD, inside(line(q, &[(-0.03, 0.0), (0.018, 0.0)], 0.003)));
    }
    c
}

fn shoe_color(p: DVec3) -> DVec3 {
    let x = p.x.abs() - 0.105;
    // A striped sock above the shoe.
    let top = 0.062 + 0.03 * (p.z * 20.0).clamp(-0.5, 0.3);
    let mut c = WHITE.lerp(TEAL, inside(stripes(p.y, 0.022)));
    let mut shoe = RED;
    shoe = shoe.lerp(CREAM, inside(0.165 - p.z));
    for z in [0.075, 0.1, 0.125] {
        shoe = shoe.lerp(WHITE, inside(((p.z - z).abs() - 0.004).max(x.abs() - 0.026)));
    }
    let mark = line(DVec2::new(p.z, p.y), &[(0.0, 0.0), (0.05, 0.035)], 0.007);
    shoe = shoe.lerp(WHITE, inside(mark.max(0.03 - x.abs())));
    shoe = shoe.lerp(WHITE, inside(p.y + 0.012));
    shoe = shoe.lerp(NAVY, inside(p.y + 0.0235));
    c = c.lerp(shoe, inside((p.y - top).min(0.07 - p.z)));
    c
}

fn head_color(p: DVec3) -> DVec3 {
    let q = DVec2::new(p.x, p.y - 1.66);
    let x = q.x.abs();
    let m = DVec2::new(x, q.y);
    let mut c = SKIN;
    if p.z > 0.0 {
        let cheek = (1.0 - DVec2::new(x - 0.09, q.y + 0.052).length() / 0.04).clamp(0.0, 1.0);
        c = c.lerp(BLUSH, 0.8 * cheek * cheek * (3.0 - 2.0 * cheek));
        c = speckle(p, c, inside(DVec2::new((x - 0.065) * 0.6, q.y + 0.035).length() - 0.028));
        // Nose tip.
        let nose = ((p.z - 0.192) / 0.025).clamp(0.0, 1.0);
        c = c.lerp(BLUSH, 0.75 * nose);
        // Eyes that look a little to one side, so that left and right differ.
        let eye = ellipse(m, DVec2::new(0.06, 0.028), DVec2::new(0.03, 0.034));
        c = c.lerp(INK, inside(eye - 0.0035));
        c = c.lerp(WHITE, inside(eye));
        let pupil = DVec2::new(q.x - 0.06 * q.x.signum() - 0.005, q.y - 0.024);
        c = c.lerp(DVec3::new(0.20, 0.52, 0.40), inside((pupil.length() - 0.0195).max(eye)));
        c = c.lerp(INK, inside((pupil.length() - 0.0115).max(eye)));
        c = c.lerp(WHITE, inside((pupil - DVec2::new(-0.006, 0.008)).length() - 0.0052));
        // Brows.
        let brow = line(m, &[(0.034, 0.086), (0.06, 0.094), (0.09, 0.08)], 0.0065);
        c = c.lerp(HAIR, inside(brow));
        // An open smile with teeth.
        let smile = ellipse(q, DVec2::new(0.0, -0.075), DVec2::new(0.052, 0.034)).max(q.y + 0.072 - 8.0 * x * x * 0.6);
        c = c.lerp(DVec3::new(0.50, 0.13, 0.13), inside(smile - 0.003));
        c = c.lerp(DVec3::new(0.86, 0.36, 0.36), inside((smile + 0.002).max(q.y + 0.095)));
        c = c.lerp(WHITE, inside((smile + 0.002).max(-0.084 - q.y)));
    }
    // Short hair: the hairline falls towards the back and leaves the ears free.
    let ear = 0.163 - x;
    let wave = 0.007 * (p.x * 75.0).sin();
    let z = p.z - 0.02;
    let hair = 0.022 + wave - q.y + if z > 0.0 { 0.76 } else { 0.95 } * z;
    // Strands run down from the crown; a whole number of them, so that they close around the head.
    let strand = (p.x.atan2(p.z + 0.03) * 44.0 + 3.0 * (p.y * 45.0).sin()).sin();
    over(c, hair.max(-ear), || HAIR * (1.0 + 0.13 * strand))
}
