//! What the layers of a transfer mean, as the command line says it.

use crate::Result;
use crate::cli::common::usage;
use crate::desk::Textures;
use crate::tools::transfer::{LayerKind, NormalY, Relief};
use crate::words::words;

/// Meanings of the layers.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct LayerKinds {
    /// What a layer holds, once per layer in their order; layers without are what their role says
    /// (normal, label, displacement), else colour
    #[arg(long, value_enum)]
    kind: Vec<KindName>,
    /// Where the green channel of tangent-space normal maps points: up in the picture (OpenGL,
    /// glTF) or down (DirectX)
    #[arg(long, value_enum, default_value = "up")]
    normal_y: NormalY,
    /// What becomes of the relief of normal and displacement maps where the surface is stretched
    #[arg(long, value_enum, default_value = "turned")]
    relief: Relief,
}

/// Names of the kinds.
#[derive(Clone, Copy, Debug)]
enum KindName {
    Color,
    Labels,
    Normal,
    NormalObject,
    Displacement,
}

words! { KindName, "kind", "a kind of texture":
    Color => "color" "Averaged",
    Labels => "labels" "Nearest texel, never mixed",
    Normal => "normal" "Tangent-space normals",
    NormalObject => "normal-object" "Object-space normals",
    Displacement => "displacement" "Heights",
}

impl LayerKinds {
    /// Gives layers their kinds.
    pub(crate) fn set(&self, layers: &mut [Textures]) -> Result<()> {
        let roles: Vec<&str> = layers.iter().map(|l| l.role.as_str()).collect();
        let kinds = self.of(&roles)?;
        layers.iter_mut().zip(kinds).for_each(|(layer, kind)| layer.kind = kind);
        Ok(())
    }

    /// The kinds of layers with these roles.
    fn of(&self, roles: &[&str]) -> Result<Vec<LayerKind>> {
        let count = roles.len();
        if self.kind.len() > count {
            return Err(usage(
                "--kind",
                &format!("{} kinds for {count} layers", self.kind.len()),
                "Give one for each layer, in their order",
            ));
        }
        let (y, relief) = (self.normal_y, self.relief);
        let kind = |name: &KindName| match name {
            KindName::Color => LayerKind::Color,
            KindName::Labels => LayerKind::Labels,
            KindName::Normal => LayerKind::TangentNormal { y, relief },
            KindName::NormalObject => LayerKind::ObjectNormal { relief },
            KindName::Displacement => LayerKind::Displacement { relief },
        };
        let by_role = |role: &&str| match *role {
            "normal" => KindName::Normal,
            "label" => KindName::Labels,
            "displacement" => KindName::Displacement,
            _ => KindName::Color,
        };
        let named = self.kind.iter().copied();
        let rest = roles.iter().skip(self.kind.len()).map(by_role);
        Ok(named.chain(rest).map(|name| kind(&name)).collect())
    }
}
