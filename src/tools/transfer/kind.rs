//! What the samples of a layer mean.

use crate::words::words;

/// What the samples of a [`Layer`](super::Layer) mean, hence how they are averaged and what the map
/// does to them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LayerKind {
    /// Values to average over footprints: colour, roughness, opacity.
    #[default]
    Color,
    /// Names, not amounts: each texel gets the stored samples of the one nearest to its image,
    /// alpha included.
    Labels,
    /// Normals in the tangent space of the texture (MikkTSpace), to be expressed in that of the
    /// target.
    TangentNormal {
        /// Where green points.
        y: NormalY,
        /// What becomes of heights.
        relief: Relief,
    },
    /// Normals in the axes of the mesh's file, to be tilted as the target's surface is.
    ObjectNormal {
        /// What becomes of heights.
        relief: Relief,
    },
    /// Heights over the surface; one half of the range of integers, and 0 of floats, is the surface
    /// itself.
    Displacement {
        /// What becomes of heights; only [`Relief::Local`] changes values.
        relief: Relief,
    },
}

/// Where the green channel of a tangent-space normal map points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NormalY {
    /// To growing v, up in the picture: OpenGL, glTF, Blender, Unity.
    #[default]
    Up,
    /// Down in the picture: DirectX, Unreal.
    Down,
}

words! { NormalY, "normal-y", "a direction of green":
    Up => "up",
    Down => "down",
}

/// What becomes of the relief that a normal or displacement map stands for, where the map stretches
/// the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Relief {
    /// Normals are turned by the rotation closest to the map's differential: shading keeps its
    /// contrast, as if the source's texture lay on the target. Heights keep their values.
    #[default]
    Turned,
    /// Heights grow with the surface around them: what is twice as large is twice as high. Where
    /// the map stretches one way, slopes become flatter that way and steeper the other.
    Local,
    /// Heights grow with the mesh as a whole and keep their values in a displacement map: what is
    /// stretched beside the rest becomes flatter.
    Mesh,
}

words! { Relief, "relief", "a treatment of relief":
    Turned => "turned" "Normals are turned and shade as before; heights keep their values",
    Local => "local" "Heights grow with the surface around them",
    Mesh => "mesh" "Heights grow with the mesh as a whole",
}

impl LayerKind {
    /// A tangent-space normal map with green up, as glTF has it.
    pub fn tangent_normal() -> Self {
        Self::TangentNormal { y: NormalY::Up, relief: Relief::Turned }
    }

    /// An object-space normal map.
    pub fn object_normal() -> Self {
        Self::ObjectNormal { relief: Relief::Turned }
    }

    /// A displacement map whose values stay as they are.
    pub fn displacement() -> Self {
        Self::Displacement { relief: Relief::Turned }
    }

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Labels => "labels",
            Self::TangentNormal { .. } => "normal",
            Self::ObjectNormal { .. } => "normal-object",
            Self::Displacement { .. } => "displacement",
        }
    }
}
