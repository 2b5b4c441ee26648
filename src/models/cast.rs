//! The characters: their measures and poses.

use glam::DVec3;

use super::body::{Body, Foot, Head, Limb, Section};

fn section(at: f64, width: f64, front: f64, back: f64) -> Section {
    Section { at, width, front, back }
}

/// Mirrors a direction from left to right.
fn mirrored(d: DVec3) -> DVec3 {
    DVec3::new(-d.x, d.y, d.z)
}

/// Standing straight with arms out to the sides: the body in whose space colours are painted.
pub(super) fn neutral() -> Body {
    let arm = Limb {
        directions: [DVec3::X; 3],
        lengths: [0.28, 0.27, 0.2],
        sizes: [
            [0.085, 0.085],
            [0.068, 0.068],
            [0.055, 0.055],
            [0.055, 0.055],
            [0.042, 0.046],
            [0.04, 0.062],
            [0.04, 0.07],
            [0.025, 0.045],
        ],
        twist: 0.0,
    };
    let leg = Limb {
        directions: [-DVec3::Y, -DVec3::Y, DVec3::Z],
        lengths: [0.4, 0.38, 0.2],
        sizes: [
            [0.1, 0.115],
            [0.095, 0.1],
            [0.075, 0.08],
            [0.07, 0.075],
            [0.07, 0.08],
            [0.05, 0.055],
            [0.055, 0.065],
            [0.0, 0.0],
        ],
        twist: 0.0,
    };
    let mut right = arm.clone();
    right.directions = right.directions.map(mirrored);
    Body {
        name: "neutral",
        spine: [DVec3::new(0.0, 0.84, 0.0), DVec3::new(0.0, 1.1, 0.0), DVec3::new(0.0, 1.42, 0.0)],
        fronts: [DVec3::Z; 2],
        torso: [
            section(0.0, 0.2, 0.12, 0.12),
            section(0.2, 0.205, 0.125, 0.13),
            section(0.42, 0.18, 0.115, 0.11),
            section(0.62, 0.2, 0.13, 0.12),
            section(0.8, 0.2, 0.13, 0.125),
            section(1.0, 0.1, 0.1, 0.1),
        ],
        shoulder: (0.87, 0.2),
        hip: 0.105,
        arms: [right, arm],
        legs: [leg.clone(), leg],
        foot: Foot { drop: 0.07, width: 0.062, heel: 0.075 },
        head: Head {
            offset: DVec3::new(0.0, 0.24, 0.02),
            radii: DVec3::new(0.155, 0.19, 0.165),
            front: DVec3::Z,
            up: DVec3::Y,
            neck: 0.07,
            nose: [0.045, 0.03],
            ear: (DVec3::new(0.04, 0.02, -0.03), 0.052),
        },
    }
}

/// Tall and thin, striding, the right arm raised.
pub(super) fn strider() -> Body {
    let d = DVec3::new;
    let mut body = neutral();
    body.name = "strider";
    let sizes = [
        [0.066, 0.064],
        [0.052, 0.05],
        [0.043, 0.042],
        [0.044, 0.043],
        [0.033, 0.036],
        [0.032, 0.05],
        [0.033, 0.06],
        [0.022, 0.04],
    ];
    let arm = |directions: [DVec3; 3], twist: f64| Limb { directions, lengths: [0.34, 0.33, 0.23], sizes, twist };
    let right = arm([d(-0.62, 0.74, 0.12), d(-0.18, 0.97, 0.2), d(0.08, 0.98, 0.18)], -1.2);
    let left = arm([d(0.5, -0.82, -0.28), d(0.3, -0.85, 0.42), d(0.2, -0.8, 0.5)], 0.0);
    let leg_sizes = [
        [0.082, 0.1],
        [0.078, 0.085],
        [0.06, 0.064],
        [0.055, 0.06],
        [0.056, 0.066],
        [0.04, 0.044],
        [0.045, 0.055],
        [0.0, 0.0],
    ];
    let leg = |directions: [DVec3; 3]| Limb { directions, lengths: [0.5, 0.49, 0.22], sizes: leg_sizes, twist: 0.0 };
    body.spine = [d(0.0, 1.02, 0.0), d(0.0, 1.32, 0.0), d(0.02, 1.66, 0.06)];
    body.fronts = [d(0.22, 0.0, 1.0), d(-0.22, 0.0, 1.0)];
    body.torso = [
        section(0.0, 0.165, 0.1, 0.1),
        section(0.2, 0.16, 0.098, 0.105),
        section(0.42, 0.128, 0.085, 0.085),
        section(0.62, 0.155, 0.1, 0.095),
        section(0.8, 0.165, 0.1, 0.1),
        section(1.0, 0.08, 0.08, 0.08),
    ];
    body.shoulder = (0.88, 0.17);
    body.hip = 0.084;
    body.arms = [right, left];
    body.legs = [
        leg([d(-0.08, -0.9, -0.36), d(-0.02, -0.76, -0.62), d(-0.05, -0.55, 0.8)]),
        leg([d(0.1, -0.8, 0.6), d(0.03, -0.99, 0.05), d(0.12, 0.2, 1.0)]),
    ];
    body.foot = Foot { drop: 0.065, width: 0.052, heel: 0.07 };
    body.head = Head {
        offset: d(0.01, 0.265, 0.035),
        radii: d(0.13, 0.195, 0.15),
        front: d(0.2, 0.03, 1.0),
        up: d(0.06, 1.0, 0.0),
        neck: 0.056,
        nose: [0.06, 0.026],
        ear: (d(0.035, 0.03, -0.03), 0.05),
    };
    body
}

/// Short and stout, standing with the arms out.
pub(super) fn stout() -> Body {
    let d = DVec3::new;
    let mut body = neutral();
    body.name = "stout";
    let sizes = [
        [0.115, 0.115],
        [0.1, 0.1],
        [0.085, 0.085],
        [0.08, 0.082],
        [0.058, 0.064],
        [0.056, 0.084],
        [0.058, 0.09],
        [0.036, 0.06],
    ];
    let arm = |directions: [DVec3; 3]| Limb { directions, lengths: [0.23, 0.23, 0.2], sizes, twist: 0.0 };
    let left = arm([d(0.93, -0.3, 0.02), d(0.92, 0.02, 0.4), d(0.95, 0.1, 0.3)]);
    let right = arm([d(-0.93, -0.22, 0.05), d(-0.85, -0.42, 0.32), d(-0.9, -0.3, 0.35)]);
    let leg_sizes = [
        [0.145, 0.17],
        [0.135, 0.145],
        [0.11, 0.115],
        [0.1, 0.105],
        [0.1, 0.108],
        [0.08, 0.086],
        [0.085, 0.1],
        [0.0, 0.0],
    ];
    let leg = |directions: [DVec3; 3]| Limb { directions, lengths: [0.27, 0.25, 0.22], sizes: leg_sizes, twist: 0.0 };
    body.spine = [d(0.0, 0.6, 0.0), d(0.0, 0.82, 0.06), d(0.0, 1.13, -0.02)];
    body.torso = [
        section(0.0, 0.29, 0.2, 0.2),
        section(0.2, 0.31, 0.26, 0.2),
        section(0.42, 0.315, 0.29, 0.19),
        section(0.62, 0.28, 0.22, 0.18),
        section(0.8, 0.25, 0.17, 0.17),
        section(1.0, 0.13, 0.13, 0.13),
    ];
    body.shoulder = (0.86, 0.235);
    body.hip = 0.16;
    body.arms = [right, left];
    body.legs = [
        leg([d(-0.16, -0.98, 0.02), d(-0.08, -0.99, -0.05), d(-0.35, 0.0, 1.0)]),
        leg([d(0.16, -0.98, 0.06), d(0.08, -0.99, -0.1), d(0.35, 0.0, 1.0)]),
    ];
    body.foot = Foot { drop: 0.08, width: 0.092, heel: 0.09 };
    body.head = Head {
        offset: d(0.0, 0.24, 0.05),
        radii: d(0.205, 0.2, 0.2),
        front: d(0.12, -0.02, 1.0),
        up: d(-0.05, 1.0, 0.0),
        neck: 0.1,
        nose: [0.05, 0.045],
        ear: (d(0.055, 0.03, -0.05), 0.066),
    };
    body
}
