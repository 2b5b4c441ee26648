//! The bones that move joints, and points fixed to them.

use glam::{DQuat, DVec3};

use super::{MAX_POSITIONS, Motion};
use crate::{Error, Result};

/// A bone: the straight line between two joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// The joint nearer to the root.
    pub from: usize,
    /// The other joint, or the end of a limb.
    pub to: usize,
    /// The joint whose rotation the bone follows.
    pub follows: usize,
}

/// What moves the joints of a [`Motion`], which are its points in the same order.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    /// The bones.
    pub segments: Vec<Segment>,
    /// Positions of the joints with all rotations zero, in the clip's units.
    pub rest: Vec<DVec3>,
    /// For each frame the rotation of each joint from rest to that frame, in the clip's axes.
    pub rotations: Vec<Vec<DQuat>>,
}

impl Skeleton {
    /// The given frames only.
    pub(super) fn part(&self, frames: impl Iterator<Item = usize>) -> Self {
        Self {
            segments: self.segments.clone(),
            rest: self.rest.clone(),
            rotations: frames.map(|f| self.rotations[f].clone()).collect(),
        }
    }
}

impl Motion {
    /// Adds a point that moves with joint `joint` as if fixed to it, `offset` away from it in the
    /// rest pose: `p(t) = joint(t) + R(t) offset`.
    ///
    /// A point beside a bone shows the rotation about the bone, which its two ends do not.
    ///
    /// # Errors
    /// [`Error::Input`] if the motion has no skeleton, there is no such joint, the name is taken,
    /// or the clip would exceed [`MAX_POSITIONS`].
    pub fn attach(&mut self, name: impl Into<String>, joint: usize, offset: DVec3) -> Result<usize> {
        let (name, file) = (name.into(), self.path.display());
        let Some(skeleton) = &self.skeleton else {
            let what = format!("{file}: points can be fixed to the bones of a skeleton only, these are markers");
            return Err(Error::input(what, "Use a BVH or an ASF with AMC"));
        };
        if joint >= skeleton.rest.len() || !offset.is_finite() || self.names.contains(&name) {
            let what = format!("{file}: point {name:?} at {offset} of joint {joint} of {}", skeleton.rest.len());
            return Err(Error::input(what, "Give a new name, a joint that exists and a finite offset"));
        }
        if self.frames.len().saturating_mul(self.names.len() + 1) > MAX_POSITIONS {
            let what = format!("{file}: with {name:?} the clip would exceed {MAX_POSITIONS} positions");
            return Err(Error::input(what, "Use a part of the clip"));
        }
        for (frame, rotations) in self.frames.iter_mut().zip(&skeleton.rotations) {
            let point = frame[joint].map(|p| p + rotations[joint] * offset);
            frame.push(point);
        }
        self.names.push(name);
        Ok(self.names.len() - 1)
    }
}
