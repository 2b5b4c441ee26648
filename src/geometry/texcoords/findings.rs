//! What is unfit about texture coordinates, in words.

use super::{Islands, Overlap, OverlapOptions, Overlaps, overlaps};
use crate::geometry::{Mesh, NONE};

/// Islands and pairs that a sentence names; the rest is counted.
const NAMED: usize = 4;
/// Pairs of triangles are passed over that have less than this share of the smaller one in common.
const SLACK: f64 = 0.01;

/// Overlapping, mirrored and missing texture coordinates of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// The islands.
    pub islands: Islands,
    /// Pairs of islands that overlap by a texel or more, the largest first.
    pub overlaps: Vec<Overlap>,
    /// Share of the surface whose triangles overlap others in the texture.
    pub overlapping_area: f64,
    /// All pairs were compared; where not, there may be more.
    pub complete: bool,
    /// Numbers of mirrored islands, those with the largest area on the surface first.
    pub mirrored: Vec<u32>,
    /// Share of the surface on mirrored islands.
    pub mirrored_area: f64,
    /// Share of the surface without texture coordinates, or without area in the texture.
    pub missing_area: f64,
}

/// Looks at the texture coordinates of `mesh` for a texture of so many `texels`.
pub fn findings(mesh: &Mesh, texels: u64, repeat: bool, by_material: bool) -> Findings {
    let islands = Islands::new(mesh);
    let found = overlaps(mesh, &islands, &OverlapOptions { repeat, by_material, slack: SLACK });
    let area = mesh.area().max(f64::MIN_POSITIVE);
    // From 0, because a sum of nothing is -0.
    let share = |triangles: &[u32]| triangles.iter().fold(0.0, |sum, &t| sum + mesh.triangle_area(t as usize)) / area;
    let Overlaps { mut overlaps, triangles, complete } = found;
    overlaps.retain(|o| o.area * texels as f64 >= 1.0);
    overlaps.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.islands.cmp(&b.islands)));
    let mut mirrored: Vec<u32> =
        (0..islands.islands.len() as u32).filter(|&i| islands.islands[i as usize].mirrored).collect();
    let area_of = |i: u32| islands.islands[i as usize].area;
    mirrored.sort_by(|&a, &b| area_of(b).total_cmp(&area_of(a)).then(a.cmp(&b)));
    let mirrored_area = mirrored.iter().fold(0.0, |sum, &i| sum + area_of(i)) / area;
    Findings {
        overlapping_area: if overlaps.is_empty() { 0.0 } else { share(&triangles) },
        mirrored_area,
        missing_area: share(&islands.missing) + share(&islands.flat),
        islands,
        overlaps,
        complete,
        mirrored,
    }
}

impl Findings {
    /// A sentence for each thing that a user should know; none for charts without fault.
    pub fn sentences(&self, mesh: &Mesh) -> Vec<String> {
        let mut said = Vec::new();
        if !self.overlaps.is_empty() {
            let pairs: Vec<String> = self.overlaps.iter().take(NAMED).map(|o| self.pair(mesh, o)).collect();
            let least = if self.complete { "" } else { "at least " };
            said.push(format!(
                "{}: islands of its texture overlap, on {least}{} of its area: {}{}. Where they do, a texel shows the face with the lowest number, \
                 and the others show what belongs to it; --unwrap makes charts that do not overlap",
                mesh.name,
                percent(self.overlapping_area),
                pairs.join("; "),
                more(self.overlaps.len(), "pairs"),
            ));
        }
        if !self.mirrored.is_empty() {
            let all = self.mirrored.len() == self.islands.islands.len();
            let named: Vec<String> = self.mirrored.iter().take(NAMED).map(|&i| self.island(mesh, i)).collect();
            said.push(format!(
                "{}: {} of {} islands of its texture are mirrored, {} of its area: {}{}. Pictures are not harmed{}",
                mesh.name,
                self.mirrored.len(),
                self.islands.islands.len(),
                percent(self.mirrored_area),
                named.join(", "),
                more(self.mirrored.len(), "islands"),
                if all {
                    "; perhaps v runs downwards in this file"
                } else {
                    "; tangent-space normal maps need the tangents' signs there"
                },
            ));
        }
        let listed = |what: &str, triangles: &[u32]| {
            let first: Vec<String> = triangles.iter().take(NAMED).map(u32::to_string).collect();
            let dots = if triangles.len() > NAMED { " ..." } else { "" };
            format!("{}: {} faces {what} ({}{dots}) get no texels", mesh.name, triangles.len(), first.join(" "))
        };
        if !self.islands.missing.is_empty() {
            said.push(listed("without texture coordinates", &self.islands.missing) + "; --unwrap makes charts for all");
        }
        if !self.islands.flat.is_empty() {
            said.push(listed("without area in the texture", &self.islands.flat));
        }
        said
    }

    fn pair(&self, mesh: &Mesh, overlap: &Overlap) -> String {
        let [a, b] = overlap.islands;
        let on = format!("on {} of the texture", percent(overlap.area));
        if a == b {
            return format!("{} with itself, {on}", self.island(mesh, a));
        }
        format!("{} and {}, {on}", self.island(mesh, a), self.island(mesh, b))
    }

    /// An island by its number, its triangles and its materials.
    fn island(&self, mesh: &Mesh, number: u32) -> String {
        let island = &self.islands.islands[number as usize];
        let names: Vec<&str> = island
            .materials
            .iter()
            .filter(|m| **m != NONE)
            .filter_map(|&m| mesh.materials.get(m as usize).map(|m| m.name.as_str()))
            .filter(|n| !n.is_empty())
            .take(NAMED)
            .collect();
        let faces = if island.triangles == 1 { "face" } else { "faces" };
        let of = if names.is_empty() { String::new() } else { format!(" of {}", names.join(", ")) };
        format!("island {number} ({} {faces}{of}, the first is {})", island.triangles, island.first)
    }
}

fn percent(share: f64) -> String {
    let p = 100.0 * share;
    if p >= 10.0 {
        format!("{p:.0} %")
    } else if p >= 0.1 {
        format!("{p:.1} %")
    } else {
        "less than 0.1 %".to_owned()
    }
}

fn more(count: usize, what: &str) -> String {
    if count > NAMED { format!(", and {} more {what}", count - NAMED) } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Corner, Material, MeshBuilder};
    use glam::{DVec2, DVec3};

    /// Squares of two triangles side by side in space; the texture of each has its lower corner and
    /// size here, and a material.
    fn squares(places: &[([f64; 3], u32)]) -> Mesh {
        let mut b = MeshBuilder::new("squares.obj");
        b.mesh.materials = ["skin", "cloth"].map(|name| Material { name: name.into(), ..Material::default() }).into();
        for (k, &([u, v, size], material)) in places.iter().enumerate() {
            let first = 4 * k as u32;
            for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                b.mesh.positions.push(DVec3::new(2.0 * k as f64 + x, y, 0.0));
                b.mesh.texcoords.push(DVec2::new(u + size * x, v + size.abs() * y));
            }
            b.material = material;
            b.polygon((first..first + 4).map(|i| Corner { vertex: i, texcoord: i, normal: NONE }));
        }
        b.finish()
    }

    #[test]
    fn sound_charts_are_not_spoken_of() {
        let mesh = squares(&[([0.0, 0.0, 0.5], 0), ([0.5, 0.0, 0.5], 1), ([0.0, 0.5, 0.5], 0)]);
        let found = findings(&mesh, 1 << 20, true, false);
        assert!(found.sentences(&mesh).is_empty(), "{found:?}");
        assert_eq!((found.islands.islands.len(), found.overlapping_area, found.mirrored_area), (3, 0.0, 0.0));
    }

    #[test]
    fn overlaps_are_named_with_islands_materials_faces_and_shares() {
        // The second lies on a quarter of the first, the third is elsewhere, the fourth on the
        // third by one repeat.
        let mesh = squares(&[
            ([0.0, 0.0, 0.4], 0),
            ([0.2, 0.2, 0.4], 1),
            ([0.7, 0.7, 0.2], 0),
            ([3.7, -1.3, 0.2], 0),
            ([0.7, 0.0, 0.2], 0),
        ]);
        let found = findings(&mesh, 1 << 20, true, false);
        let pairs: Vec<[u32; 2]> = found.overlaps.iter().map(|o| o.islands).collect();
        assert_eq!(pairs, [[0, 1], [2, 3]]);
        assert!((found.overlaps[0].area - 0.04).abs() < 1e-9 && (found.overlaps[1].area - 0.04).abs() < 1e-9);
        // Of the first two squares the triangles that meet: one half of each lies apart from the
        // common corner or not at all.
        assert!(found.overlapping_area > 0.55 && found.overlapping_area <= 0.8 + 1e-9, "{}", found.overlapping_area);
        let text = found.sentences(&mesh).join("\n");
        for part in [
            "squares.obj",
            "island 0 (2 faces of skin, the first is 0)",
            "island 1 (2 faces of cloth, the first is 2)",
            "4.0 %",
            "--unwrap",
        ] {
            assert!(text.contains(part), "{part:?} is not in {text}");
        }
        // On textures of their own the first two do not meet; without repeats the last two do not.
        assert_eq!(findings(&mesh, 1 << 20, true, true).overlaps.len(), 1);
        assert_eq!(findings(&mesh, 1 << 20, false, false).overlaps.len(), 1);
    }

    #[test]
    fn mirrored_islands_and_faces_without_place_are_named() {
        let mut mesh = squares(&[([0.0, 0.0, 0.4], 0), ([0.9, 0.0, -0.4], 1), ([0.0, 0.5, 0.0], 0)]);
        let found = findings(&mesh, 1 << 20, true, false);
        assert_eq!(found.mirrored, [1]);
        assert!((found.mirrored_area - 1.0 / 3.0).abs() < 1e-12 && (found.missing_area - 1.0 / 3.0).abs() < 1e-12);
        let text = found.sentences(&mesh).join("\n");
        assert!(text.contains("1 of 2 islands") && text.contains("cloth") && text.contains("33 %"), "{text}");
        assert!(text.contains("2 faces without area in the texture (4 5)"), "{text}");
        mesh.texcoords.iter_mut().for_each(|t| t.y = 1.0 - t.y);
        assert_eq!(findings(&mesh, 1 << 20, true, false).mirrored, [0]);
    }

    #[test]
    fn islands_that_touch_up_to_rounding_do_not_overlap() {
        let mesh = squares(&[([0.0, 0.0, 0.5 + 1e-4], 0), ([0.5, 0.0, 0.5], 1)]);
        assert!(findings(&mesh, 1 << 24, true, false).overlaps.is_empty());
        assert_eq!(overlaps(&mesh, &Islands::new(&mesh), &OverlapOptions::default()).overlaps.len(), 1);
    }
}
