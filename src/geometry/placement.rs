//! How a picture lies on a surface: the way from a mesh's texture coordinates to places in the
//! picture.

use glam::{DAffine2, DMat2, DVec2};

/// What a picture shows beyond its borders, along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// Itself again.
    #[default]
    Repeat,
    /// Its border texels.
    Clamp,
    /// Itself again, every other time mirrored.
    Mirror,
}

impl Wrap {
    /// The coordinate in 0..=1 that a renderer shows for `x`.
    pub fn fold(self, x: f64) -> f64 {
        match self {
            Self::Repeat => x - x.floor(),
            Self::Clamp => x.clamp(0.0, 1.0),
            Self::Mirror => {
                let y = x - 2.0 * (0.5 * x).floor();
                if y > 1.0 { 2.0 - y } else { y }
            }
        }
    }

    /// The index of the texel shown for texel `index` of a side of `n` texels.
    #[inline]
    pub fn texel(self, index: i64, n: u32) -> u32 {
        let n = i64::from(n);
        let inside = match self {
            Self::Repeat => index.rem_euclid(n),
            Self::Clamp => index.clamp(0, n - 1),
            Self::Mirror => {
                let i = index.rem_euclid(2 * n);
                if i < n { i } else { 2 * n - 1 - i }
            }
        };
        inside as u32
    }
}

/// How a texture of a material lies on the surface.
///
/// Texture coordinates of a mesh and of a picture both have v = 1 at the picture's top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Along u and along v.
    pub wrap: [Wrap; 2],
    /// From the mesh's texture coordinates to the picture's.
    pub transform: DAffine2,
}

impl Default for Placement {
    /// The texture coordinates as they are, repeating.
    fn default() -> Self {
        Self { wrap: [Wrap::Repeat; 2], transform: DAffine2::IDENTITY }
    }
}

impl Placement {
    /// As the options `-s` and `-o` of an MTL file: coordinates times `scale` plus `offset`.
    pub fn scaled(scale: DVec2, offset: DVec2) -> Self {
        let transform = DAffine2 { matrix2: DMat2::from_diagonal(scale), translation: offset };
        Self { transform, ..Self::default() }
    }

    /// As the glTF extension KHR_texture_transform: in its coordinates, whose v runs down, scaled,
    /// then rotated, then moved.
    ///
    /// The rotation is that of renderers and of the Khronos sample model: the coordinates turn
    /// counter-clockwise as seen on the picture. The matrix printed in the extension's text turns
    /// the other way (glTF issue 1563).
    pub fn of_gltf(offset: DVec2, rotation: f64, scale: DVec2) -> Self {
        let (sin, cos) = rotation.sin_cos();
        // Column by column.
        let turn = DMat2::from_cols(DVec2::new(cos, -sin), DVec2::new(sin, cos));
        let inner = DAffine2 { matrix2: turn * DMat2::from_diagonal(scale), translation: offset };
        Self { transform: flipped(inner), ..Self::default() }
    }

    /// Offset, rotation and scale of KHR_texture_transform for this placement. Exact, but for
    /// rounding, as long as the transform shears nothing, which no format can say.
    pub fn to_gltf(&self) -> (DVec2, f64, DVec2) {
        let inner = flipped(self.transform);
        let (x, y) = (inner.matrix2.x_axis, inner.matrix2.y_axis);
        // The first column is scale.x (cos, -sin), the second scale.y (sin, cos).
        let rotation = if x == DVec2::ZERO { y.x.atan2(y.y) } else { (-x.y).atan2(x.x) };
        let (sin, cos) = rotation.sin_cos();
        let scale = DVec2::new(x.dot(DVec2::new(cos, -sin)), y.dot(DVec2::new(sin, cos)));
        (inner.translation, rotation, scale)
    }

    /// The place in the picture of a texture coordinate of the mesh, before wrapping.
    pub fn apply(&self, texcoord: DVec2) -> DVec2 {
        self.transform.transform_point2(texcoord)
    }

    /// Whether texture coordinates are places in the picture as they are.
    pub fn keeps_coordinates(&self) -> bool {
        self.transform == DAffine2::IDENTITY
    }
}

/// The transform seen in coordinates whose v runs the other way.
fn flipped(transform: DAffine2) -> DAffine2 {
    let flip = DAffine2 { matrix2: DMat2::from_diagonal(DVec2::new(1.0, -1.0)), translation: DVec2::Y };
    if transform == DAffine2::IDENTITY { transform } else { flip * transform * flip }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_fold_as_texels_do() {
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            for n in [1_u32, 2, 5] {
                for index in -11..12 {
                    let folded = wrap.fold((f64::from(index) + 0.5) / f64::from(n));
                    let texel = (folded * f64::from(n)).min(f64::from(n) - 0.5) as u32;
                    assert_eq!(wrap.texel(i64::from(index), n), texel, "{wrap:?} {index} of {n}");
                }
            }
        }
        assert_eq!([-0.25, 1.25, 2.25].map(|x| Wrap::Mirror.fold(x)), [0.25, 0.75, 0.25]);
        assert_eq!([-0.25, 1.25].map(|x| Wrap::Clamp.fold(x)), [0.0, 1.0]);
        assert_eq!([-0.25, 1.25].map(|x| Wrap::Repeat.fold(x)), [0.75, 0.25]);
    }

    #[test]
    fn gltf_transforms_scale_then_turn_then_move_and_come_back() {
        let quarter = std::f64::consts::FRAC_PI_2;
        // In glTF's coordinates (1, 0) is scaled to (2, 0), turned up on the picture to (0, -2),
        // and moved.
        let placement = Placement::of_gltf(DVec2::new(0.5, 0.25), quarter, DVec2::new(2.0, 3.0));
        let at = |u: f64, v: f64| {
            let p = placement.apply(DVec2::new(u, 1.0 - v));
            DVec2::new(p.x, 1.0 - p.y)
        };
        assert!(at(1.0, 0.0).distance(DVec2::new(0.5, -1.75)) < 1e-12, "{}", at(1.0, 0.0));
        assert!(at(0.0, 1.0).distance(DVec2::new(3.5, 0.25)) < 1e-12, "{}", at(0.0, 1.0));
        for (rotation, scale) in [(0.3, [2.0, -1.5]), (-2.0, [0.5, 0.25]), (0.0, [-1.0, 1.0]), (1.0, [0.0, 2.0])] {
            let placement = Placement::of_gltf(DVec2::new(-0.1, 7.0), rotation, scale.into());
            let (offset, rotation, scale) = placement.to_gltf();
            let again = Placement::of_gltf(offset, rotation, scale);
            assert!(again.transform.abs_diff_eq(placement.transform, 1e-12), "{placement:?} {again:?}");
        }
        assert!(Placement::of_gltf(DVec2::ZERO, 0.0, DVec2::ONE).keeps_coordinates());
        assert_eq!(
            Placement::scaled(DVec2::new(2.0, -3.0), DVec2::new(0.5, 0.25)).apply(DVec2::ONE),
            DVec2::new(2.5, -2.75)
        );
    }
}
