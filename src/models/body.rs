//! Proportions and pose of a character, and the control positions that follow from them.
//!
//! Each limb is a small skeleton of three bones. Cross-sections stand along it, turn smoothly at
//! its joints and carry six control vertices each, so that the limb bends without a crease wherever
//! its bones point.

use glam::DVec3;

use super::cage::{Cage, LEG_SEGMENTS, Lattice, TORSO_TOP};

/// Stations of an arm along its bones (1 is the elbow, 2 the wrist, 3 the finger tips).
const ARM_STATIONS: [f64; 8] = [0.0, 0.36, 0.8, 1.22, 1.97, 2.3, 2.72, 3.0];
/// Stations of a leg along its bones (1 is the knee, 2 the ankle); the sole follows.
const LEG_STATIONS: [f64; 7] = [0.0, 0.32, 0.82, 1.18, 1.5, 1.84, 2.0];

/// An arm or a leg. Directions are in the world, lengths in metres.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    /// Directions of the three bones; of a leg's third, the foot, from heel to toes.
    pub(super) directions: [DVec3; 3],
    /// Their lengths.
    pub(super) lengths: [f64; 3],
    /// Half sizes of the cross-section at each station: across (up for arms, sideways for legs) and
    /// front to back.
    pub(super) sizes: [[f64; 2]; 8],
    /// Turn of the hand about the forearm, radians.
    pub(super) twist: f64,
}

/// A cross-section of the torso.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section {
    /// Place along the spine, 0 at the crotch, 1 at the neck.
    pub(super) at: f64,
    /// Half width.
    pub(super) width: f64,
    /// Half depth to the front.
    pub(super) front: f64,
    /// Half depth to the back.
    pub(super) back: f64,
}

/// What makes a character.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) name: &'static str,
    /// Control points of the spine's quadratic curve from the crotch to the base of the neck.
    pub(super) spine: [DVec3; 3],
    /// The body's front at the pelvis and at the shoulders.
    pub(super) fronts: [DVec3; 2],
    /// Cross-sections of lattice rows 0 to 5; the last one holds the neck.
    pub(super) torso: [Section; 6],
    /// Place of the shoulders along the spine and their half distance.
    pub(super) shoulder: (f64, f64),
    /// Half distance of the hips.
    pub(super) hip: f64,
    /// Right and left.
    pub(super) arms: [Limb; 2],
    /// Right and left.
    pub(super) legs: [Limb; 2],
    /// The feet.
    pub(super) foot: Foot,
    /// The head.
    pub(super) head: Head,
}

/// Sizes of the feet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    /// From the ankle down to the sole.
    pub(super) drop: f64,
    /// Half width at the ball.
    pub(super) width: f64,
    /// From the ankle back to the heel.
    pub(super) heel: f64,
}

/// The head.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    /// From the base of the neck to the centre, in the world.
    pub(super) offset: DVec3,
    /// Half sizes to the side, up and to the front.
    pub(super) radii: DVec3,
    /// Where the face looks.
    pub(super) front: DVec3,
    /// Up of the head; made perpendicular to the front.
    pub(super) up: DVec3,
    /// Half width of the neck.
    pub(super) neck: f64,
    /// How far the nose stands out, and its half size.
    pub(super) nose: [f64; 2],
    /// Left ear tip from the ear's root: outwards, up, to the front; and its half size.
    pub(super) ear: (DVec3, f64),
}

/// Three perpendicular directions at a place.
#[derive(Clone, Copy, Debug)]
struct Frame {
    origin: DVec3,
    side: DVec3,
    up: DVec3,
    front: DVec3,
}

impl Frame {
    fn point(&self, side: f64, up: f64, front: f64) -> DVec3 {
        self.origin + self.side * side + self.up * up + self.front * front
    }
}

/// Control vertices lie outside the smooth surface; a six-sided ring has to be this much larger.
const RING: f64 = 1.2;

/// Place `k` (0, 1, 2) across a hexagon with corners at the ends: along its long and short way.
fn hexagon(positive: bool, k: i32) -> (f64, f64) {
    let sign = if positive { 1.0 } else { -1.0 };
    let across = if k == 1 { 1.0 } else { 0.5 };
    (RING * sign * across, RING * 0.866 * f64::from(k - 1))
}

impl Body {
    /// Control position of every vertex of the cage.
    pub(super) fn control_positions(&self, cage: &Cage) -> Vec<DVec3> {
        let posed = Posed::new(self);
        cage.vertices.iter().map(|&l| posed.place(l)).collect()
    }
}

/// A body with the frames of all its cross-sections.
struct Posed<'a> {
    body: &'a Body,
    torso: [Frame; 6],
    arms: [Vec<Frame>; 2],
    legs: [Vec<Frame>; 2],
    head: Frame,
}

impl<'a> Posed<'a> {
    fn new(body: &'a Body) -> Self {
        let spine = |t: f64| body.spine_frame(t);
        let torso = body.torso.map(|s| spine(s.at));
        let arm = |side: usize| {
            let sign = if side == 1 { 1.0 } else { -1.0 };
            let mut root = spine(body.shoulder.0);
            root.origin += root.side * (sign * body.shoulder.1);
            // Seen along the arm, "side" is the way up and "front" the front.
            let limb = &body.arms[side];
            limb_frames(limb, &ARM_STATIONS, root.origin, root.side * sign, root.up, limb.twist, |t, up| {
                t.cross(up) * sign
            })
        };
        let leg = |side: usize| {
            let sign = if side == 1 { 1.0 } else { -1.0 };
            let mut root = torso[0];
            root.origin += root.side * (sign * body.hip);
            limb_frames(&body.legs[side], &LEG_STATIONS, root.origin, -root.up, root.side, 0.0, |t, side| t.cross(side))
        };
        let front = body.head.front.normalize();
        let side = body.head.up.cross(front).normalize();
        let head = Frame { origin: torso[5].origin + body.head.offset, side, up: front.cross(side), front };
        Self { body, torso, arms: [arm(0), arm(1)], legs: [leg(0), leg(1)], head }
    }

    fn place(&self, [x, y, z]: Lattice) -> DVec3 {
        if y > TORSO_TOP {
            self.head_vertex(x, y, z)
        } else if y < 0 {
            let side = usize::from(x >= 2);
            self.leg_vertex(side, x - 2 * side as i32, y, z)
        } else if x <= 0 && y >= TORSO_TOP - 1 {
            self.arm_vertex(0, -x, y, z)
        } else if x >= 3 && y >= TORSO_TOP - 1 {
            self.arm_vertex(1, x - 3, y, z)
        } else if y == 0 {
            let side = usize::from(x >= 2);
            self.ring(&self.legs[side][0], self.body.legs[side].sizes[0], x - 2 * side as i32 == 1, z)
        } else if y == TORSO_TOP {
            let neck = self.body.head.neck;
            self.ring(&self.torso[5], [neck, neck], x == 2, z)
        } else {
            self.torso_vertex(x, y, z)
        }
    }

    fn ring(&self, frame: &Frame, size: [f64; 2], positive: bool, k: i32) -> DVec3 {
        let (a, b) = hexagon(positive, k);
        frame.point(a * size[0], 0.0, b * size[1])
    }

    fn torso_vertex(&self, x: i32, y: i32, z: i32) -> DVec3 {
        let section = self.body.torso[y as usize];
        let depth = if z == 0 { -section.back } else { section.front };
        let (a, b) = match (x, z) {
            (0 | 3, 1) => (1.04, 0.0),
            (0 | 3, _) => (0.86, 0.66),
            _ => (0.38, 1.12),
        };
        let sign = if x >= 2 { 1.0 } else { -1.0 };
        self.torso[y as usize].point(sign * a * section.width, 0.0, b * depth)
    }

    fn arm_vertex(&self, side: usize, station: i32, y: i32, z: i32) -> DVec3 {
        let limb = &self.body.arms[side];
        let station = station as usize;
        let frame = &self.arms[side][station];
        let base = self.ring(frame, limb.sizes[station], y == TORSO_TOP, z.min(2));
        if z < 3 {
            return base;
        }
        // The thumb: its two ends follow the hand and lean out to the front and towards the finger
        // tips.
        let [a, b] = limb.sizes[5];
        let toward = limb.directions[2].normalize();
        let tip = self.arms[side][5].origin.lerp(self.arms[side][6].origin, 0.55);
        let across = if y == TORSO_TOP { 0.5 } else { -0.5 };
        let along = if station == 5 { -0.3 } else { 0.45 };
        tip + frame.front * (b * 2.15) + toward * ((0.7 + along) * b) + frame.side * (across * a)
    }

    fn leg_vertex(&self, side: usize, x: i32, y: i32, z: i32) -> DVec3 {
        let limb = &self.body.legs[side];
        let frames = &self.legs[side];
        let station = -y;
        let positive = x == 1;
        if station < LEG_SEGMENTS - 1 {
            return self.ring(&frames[station as usize], limb.sizes[station as usize], positive, z);
        }
        // The foot has its own frame: it points where it is told and stands across the shin.
        let ankle = frames[6].origin;
        let front = limb.directions[2].normalize();
        let side = (frames[6].side - front * frames[6].side.dot(front)).normalize();
        let frame = Frame { origin: ankle, side, up: front.cross(side), front };
        let foot = self.body.foot;
        let sign = if positive { 1.0 } else { -1.0 };
        let length = limb.lengths[2];
        let [a, b] = limb.sizes[6];
        if station == LEG_SEGMENTS - 1 {
            return match z {
                0..=2 => {
                    let (p, q) = hexagon(positive, z);
                    frame.point(p * a, 0.0, q * b)
                }
                3 => frame.point(sign * foot.width * 0.75, -foot.drop * 0.34, length * 0.62),
                _ => frame.point(sign * foot.width * 0.7, -foot.drop * 0.52, length * 1.04),
            };
        }
        let (width, forward) = match z {
            0 => (0.66, -foot.heel),
            1 => (0.92, -0.1 * foot.heel),
            2 => (0.95, 0.3 * length),
            3 => (1.15, 0.7 * length),
            _ => (0.72, 1.08 * length),
        };
        frame.point(sign * foot.width * width, -foot.drop * 1.15, forward)
    }

    fn head_vertex(&self, x: i32, y: i32, z: i32) -> DVec3 {
        let head = self.body.head;
        let frame = &self.head;
        let sign = if x >= 2 { 1.0 } else { -1.0 };
        if y == TORSO_TOP + 1 && (x == 1 || x == 2) {
            // Where the neck enters: a ring about it under the chin, drawn down to the back.
            let (a, b) = hexagon(x == 2, z);
            return frame.point(a * head.neck * 1.05, -0.86 * head.radii.y, b * head.neck - 0.12 * head.radii.z);
        }
        let inner = x == 1 || x == 2;
        let middle = y == 7 || y == 8;
        let fx = match (inner, z) {
            (false, _) => 1.0,
            (true, 2 | 3) if middle => 0.24,
            (true, _) => 0.36,
        };
        // The ears stand on quads beside the middle, smaller than their share of the head.
        let beside = !inner && middle && z < 2;
        let fy = match y {
            6 => -1.0,
            7 if beside => -0.24,
            7 => -0.36,
            8 if beside => 0.17,
            8 => 0.26,
            _ => 1.0,
        };
        let fz = match z {
            0 if beside => -0.56,
            1 if beside => -0.1,
            _ => f64::from(z.min(2) - 1),
        };
        let cube = DVec3::new(sign * fx, fy, fz);
        // Between a ball and a box.
        let norm = cube.abs().to_array().iter().map(|c| c.powf(2.6)).sum::<f64>().powf(1.0 / 2.6);
        let p = cube / norm * head.radii * 1.14;
        let ear = x == 4 || x == -1;
        if ear {
            let root = DVec3::new(sign * head.radii.x * 1.05, 0.0, -0.3 * head.radii.z);
            let (offset, size) = head.ear;
            let dy = if y == 8 { 1.0 } else { -1.0 };
            let dz = if z == 1 { 0.5 } else { -0.9 };
            let tip = root + DVec3::new(sign * offset.x, offset.y, offset.z) + DVec3::new(0.0, dy, dz) * size;
            return frame.point(tip.x, tip.y, tip.z);
        }
        if z == 3 {
            let [out, size] = head.nose;
            let dy = if y == 8 { 0.75 } else { -0.9 };
            let lean = if y == 8 { 0.65 } else { 1.0 };
            return frame.point(sign * size, dy * size - 0.08 * head.radii.y, head.radii.z * 0.98 + out * lean);
        }
        frame.point(p.x, p.y, p.z)
    }
}

impl Body {
    fn spine_frame(&self, t: f64) -> Frame {
        let [a, b, c] = self.spine;
        let origin = a * ((1.0 - t) * (1.0 - t)) + b * (2.0 * t * (1.0 - t)) + c * (t * t);
        let up = ((b - a) * (1.0 - t) + (c - b) * t).normalize();
        let facing = self.fronts[0].lerp(self.fronts[1], t);
        let side = up.cross(facing).normalize();
        Frame { origin, side, up, front: side.cross(up) }
    }
}

/// Frames at the stations of a limb. `inward` is the direction in which the limb leaves the torso,
/// `across` its side at the root and `front` gives the third direction from the tangent and the
/// side.
fn limb_frames(
    limb: &Limb,
    stations: &[f64],
    root: DVec3,
    inward: DVec3,
    across: DVec3,
    twist: f64,
    front: impl Fn(DVec3, DVec3) -> DVec3,
) -> Vec<Frame> {
    let bones = limb.directions.map(DVec3::normalize);
    let mut joints = [root; 4];
    for k in 0..3 {
        joints[k + 1] = joints[k] + bones[k] * limb.lengths[k];
    }
    let mut side = across;
    let mut frames = Vec::with_capacity(stations.len());
    for &t in stations {
        let bone = (t as usize).min(2);
        let origin = joints[bone].lerp(joints[bone + 1], t - bone as f64);
        // Turn from one bone into the next within a quarter of a bone on either side of the joint.
        let mut tangent = if t == 0.0 { (inward * 0.8 + bones[0]).normalize() } else { bones[bone] };
        for joint in 1..3 {
            let s = (t - joint as f64) / 0.5 + 0.5;
            if t > 0.0 && (0.0..=1.0).contains(&s) {
                tangent = bones[joint - 1].lerp(bones[joint], s).normalize();
            }
        }
        side = (side - tangent * side.dot(tangent)).normalize();
        let mut across = side;
        if twist != 0.0 && t > 1.0 {
            let turn = glam::DQuat::from_axis_angle(tangent, twist * (t - 1.0).min(1.0));
            across = turn * side;
        }
        frames.push(Frame { origin, side: across, up: tangent, front: front(tangent, across) });
    }
    frames
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::cast;

    #[test]
    fn control_positions_are_finite_and_distinct() {
        let cage = Cage::new();
        for body in [cast::neutral(), cast::strider(), cast::stout()] {
            let p = body.control_positions(&cage);
            assert!(p.iter().all(|p| p.is_finite()), "{}", body.name);
            for (i, a) in p.iter().enumerate() {
                assert!(p[..i].iter().all(|b| a.distance(*b) > 1e-3), "{} vertex {i}", body.name);
            }
        }
    }
}
