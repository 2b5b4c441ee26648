//! Which textures of the source are transferred: `--texture`, or those that its materials name.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use barymap::geometry::material::{BASE_COLOR, Placement, ROLES, TextureContent};
use barymap::geometry::{Mesh, NONE};
use barymap::io::TextureName;
use barymap::io::image_file::{Metadata, read_texture};
use barymap::raster::Image;
use barymap::tools::transfer::{LayerKind, TilesUsed, UvTile, holds_normals};
use barymap::{Error, Result};

use super::appearance::{self, Appearance};
use crate::common::{Session, Surface, usage};

/// What `--texture` says for the colours of vertices, in both spellings.
const VERTEX_COLORS: [&str; 2] = ["vertex-colors", "vertex-colours"];

/// The pictures of one layer and how the source uses them.
#[derive(Debug)]
pub(crate) struct Textures {
    /// What the layer is for: `base_color`, `roughness` ...
    pub(crate) role: String,
    pub(crate) images: Vec<Image>,
    /// How each picture lies on the source.
    pub(crate) placements: Vec<Placement>,
    /// Whether the pictures are multiplied by their materials' factors already.
    pub(crate) multiplied: bool,
    /// Colours of the vertices, in place of pictures.
    pub(crate) vertices: Option<Vec<[f32; 4]>>,
    pub(crate) material_texture: Vec<u32>,
    pub(crate) default_texture: u32,
    /// Picture of each triangle, where tiles decide it.
    pub(crate) face_texture: Option<Vec<u32>>,
    pub(crate) kind: LayerKind,
    /// What the files of the pictures say of their colours.
    pub(crate) metadata: Metadata,
}

impl Textures {
    fn empty(role: &str, source: &Mesh) -> Self {
        Self {
            role: role.to_owned(),
            images: Vec::new(),
            placements: Vec::new(),
            multiplied: false,
            vertices: None,
            material_texture: vec![NONE; source.materials.len()],
            default_texture: NONE,
            face_texture: None,
            kind: LayerKind::Color,
            metadata: Metadata::default(),
        }
    }

    /// One picture for the whole source.
    pub(crate) fn single(image: Image) -> Self {
        Self {
            role: BASE_COLOR.to_owned(),
            images: vec![image],
            placements: Vec::new(),
            multiplied: false,
            vertices: None,
            material_texture: Vec::new(),
            default_texture: 0,
            face_texture: None,
            kind: LayerKind::Color,
            metadata: Metadata::default(),
        }
    }

    /// The colours of the source's vertices.
    fn of_vertices(role: &str, source: &Mesh) -> Result<Self> {
        if source.colors.is_empty() {
            let what = format!("{} has no vertex colours", source.name);
            return Err(usage("--texture", &what, "Name a picture, or export the mesh with its colours"));
        }
        let default_texture = if source.materials.is_empty() { 0 } else { NONE };
        let material_texture = vec![0; source.materials.len()];
        let vertices = Some(source.colors.clone());
        Ok(Self { vertices, default_texture, material_texture, ..Self::empty(role, source) })
    }

    /// Whether the source needs texture coordinates for it.
    pub(crate) fn needs_texcoords(&self) -> bool {
        self.images.iter().any(|i| (i.width, i.height) != (1, 1))
    }

    /// Picture of each triangle.
    fn of_faces(&self, source: &Mesh) -> Vec<u32> {
        let of = |t| {
            let material = source.triangle_material(t) as usize;
            self.material_texture.get(material).copied().unwrap_or(self.default_texture)
        };
        (0..source.triangle_count()).map(of).collect()
    }
}

/// One `--texture`.
struct Request {
    role: Option<String>,
    material: Option<String>,
    name: TextureName,
}

impl Request {
    /// `FILE`, `MATERIAL=FILE`, `ROLE=FILE` or `ROLE:MATERIAL=FILE`.
    fn parse(text: &str, source: &Mesh) -> Result<Self> {
        let has = |name: &str| source.materials.iter().any(|m| m.name == name);
        let request = |role: Option<&str>, material: Option<&str>, file: &str| Self {
            role: role.map(str::to_owned),
            material: material.map(str::to_owned),
            name: TextureName::new(file),
        };
        let Some((left, file)) = text.split_once('=').filter(|_| !Path::new(text).exists()) else {
            return Ok(request(None, None, text));
        };
        if has(left) {
            return Ok(request(None, Some(left), file));
        }
        if ROLES.contains(&left) {
            return Ok(request(Some(left), None, file));
        }
        let word =
            |s: &str| !s.is_empty() && s.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
        match left.split_once(':').filter(|(role, _)| word(role)) {
            Some((role, "*")) => Ok(request(Some(role), None, file)),
            Some((role, material)) if has(material) => Ok(request(Some(role), Some(material), file)),
            _ => {
                let names: Vec<&str> = source.materials.iter().map(|m| m.name.as_str()).take(20).collect();
                let materials = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                Err(usage(
                    "--texture",
                    &format!("{left:?} is neither a material of {} nor a role", source.name),
                    &format!(
                        "Write FILE, MATERIAL=FILE, ROLE=FILE or ROLE:MATERIAL=FILE. Its materials: {materials}. Roles: {}; others as ROLE:*=FILE",
                        ROLES.join(", ")
                    ),
                ))
            }
        }
    }
}

/// The layers that `--texture` asks for; without it those of the source's materials, in all roles if `all_roles`.
pub(crate) fn textures(
    texts: &[String],
    all_roles: bool,
    source: &Surface,
    session: &Session<'_>,
) -> Result<Vec<Textures>> {
    let mesh = &source.mesh;
    if texts.is_empty() {
        return materials_textures(mesh, all_roles, Some(session));
    }
    let requests: Vec<Request> = texts.iter().map(|t| Request::parse(t, mesh)).collect::<Result<_>>()?;
    let plain = requests.iter().filter(|r| r.role.is_none() && r.material.is_none()).count();
    let bare = requests.iter().filter(|r| r.role.is_none() && r.material.is_some()).count();
    if plain > 0 && bare > 0 {
        return Err(usage(
            "--texture",
            "some textures name a material and others do not",
            "Name a material for each, or for none; or say the role, too: base_color=FILE with base_color:MATERIAL=FILE",
        ));
    }
    // Layers in the order of their first mention.
    let mut layers: Vec<(String, Vec<Request>)> = Vec::new();
    for request in requests {
        let role = match (&request.role, &request.material) {
            (Some(role), _) => role.clone(),
            (None, Some(_)) => BASE_COLOR.to_owned(),
            (None, None) if layers.is_empty() => BASE_COLOR.to_owned(),
            // Further files without a name are layers of their own, as many as there are outputs.
            (None, None) => format!("layer{}", layers.len() + 1),
        };
        match layers.iter_mut().find(|l| l.0 == role) {
            Some((_, known)) if known.iter().any(|r| r.material == request.material) => {
                let what =
                    format!("{role} of {} is given twice", request.material.as_deref().unwrap_or("all materials"));
                return Err(usage("--texture", &what, "Give each once, or put a role before it: ROLE=FILE"));
            }
            Some((_, known)) => known.push(request),
            None => layers.push((role, vec![request])),
        }
    }
    layers.iter().map(|(role, requests)| layer(role, requests, mesh, session)).collect()
}

fn layer(role: &str, requests: &[Request], source: &Mesh, session: &Session<'_>) -> Result<Textures> {
    if requests.iter().any(|r| VERTEX_COLORS.contains(&r.name.text())) {
        if let [Request { material: None, .. }] = requests {
            return Textures::of_vertices(role, source);
        }
        let what = "vertex colours are those of all materials";
        return Err(usage("--texture", what, "Give vertex-colors alone for its role, without a material"));
    }
    let mut reader = Reader::new(Textures::empty(role, source), source, Some(session));
    let named: BTreeSet<u32> = requests.iter().flat_map(|r| reader.materials(r.material.as_deref())).collect();
    for request in requests {
        let materials = reader.materials(request.material.as_deref());
        let rest = request.material.is_none();
        let wanted = |m: u32| if rest { !named.contains(&m) } else { materials.contains(&m) };
        reader.add(&request.name, wanted)?;
    }
    if role == "height" && reader.layer.images.iter().any(holds_normals) {
        session.warn("the height texture looks like a normal map; if it is one, give it as normal=FILE");
    }
    reader.finish()
}

/// What the source's own materials show as base colour; the colours of its vertices where they name no picture.
pub(crate) fn own_textures(source: &Surface) -> Result<Textures> {
    let layers = materials_textures(&source.mesh, false, None)?;
    layers.into_iter().next().ok_or_else(|| none(&source.mesh))
}

fn none(source: &Mesh) -> Error {
    usage("--texture", &format!("{} names no texture", source.name), "Give it with --texture FILE")
}

fn materials_textures(source: &Mesh, all_roles: bool, session: Option<&Session<'_>>) -> Result<Vec<Textures>> {
    let tell = |text: &str| session.iter().for_each(|s| s.warn(text));
    let mut appearance = Appearance::new(source);
    if all_roles {
        appearance.recognise_normals(tell);
    }
    let mut layers = Vec::new();
    let by_vertices = !source.colors.is_empty() && !appearance.has_pictures(BASE_COLOR);
    if by_vertices {
        tell(&format!("{} names no picture: its vertex colours are taken", source.name));
        layers.push(Textures::of_vertices(BASE_COLOR, source)?);
    } else if !source.colors.is_empty() {
        tell(&format!("{} has vertex colours beside its pictures; --texture vertex-colors takes them", source.name));
    }
    let wanted = |role: &&str| if *role == BASE_COLOR { !by_vertices } else { all_roles };
    let shown = |role: &&str| if *role == BASE_COLOR { appearance.shows(role) } else { appearance.has_pictures(role) };
    for role in ROLES.into_iter().filter(|r| wanted(r) && shown(r)) {
        let mut reader = Reader::new(Textures::empty(role, source), source, session);
        reader.layer.multiplied = true;
        let mut add = || appearance.used().try_for_each(|m| reader.add_appearance(&appearance, m));
        match (add(), session) {
            (Ok(()), _) => layers.push(reader.finish()?),
            // The base colour is what is asked for; of the rest what can be read comes along.
            (Err(error), Some(session)) if role != BASE_COLOR => session.warn(&format!("{role} is left out: {error}")),
            (Err(error), _) => return Err(error),
        }
    }
    if layers.is_empty() { Err(none(source)) } else { Ok(layers) }
}

/// A layer as its pictures are read.
struct Reader<'a> {
    layer: Textures,
    source: &'a Mesh,
    session: Option<&'a Session<'a>>,
    /// Pictures of files, by how they lie.
    known: Vec<(PathBuf, Placement, u32)>,
    /// Whether a file told of its colours yet.
    told: bool,
}

impl<'a> Reader<'a> {
    fn new(layer: Textures, source: &'a Mesh, session: Option<&'a Session<'a>>) -> Self {
        Self { layer, source, session, known: Vec::new(), told: false }
    }

    fn warn(&self, text: &str) {
        if let Some(session) = self.session {
            session.warn(text);
        }
    }

    /// Indices of the materials of a name.
    fn materials(&self, name: Option<&str>) -> Vec<u32> {
        let all = self.source.materials.iter().enumerate();
        all.filter(|(_, m)| Some(m.name.as_str()) == name).map(|(k, _)| k as u32).collect()
    }

    /// Reads a picture that lies on the source in this way.
    fn picture(&mut self, path: PathBuf, placement: Placement) -> Result<u32> {
        if let Some((.., known)) = self.known.iter().find(|(p, placed, _)| *p == path && *placed == placement) {
            return Ok(*known);
        }
        let image = self.read(&path)?;
        let index = self.push(image, placement);
        self.known.push((path, placement, index));
        Ok(index)
    }

    /// The pixels of a file; what it tells of their colours is kept for the layer.
    fn read(&mut self, path: &Path) -> Result<Image> {
        let picture = read_texture(path)?;
        for note in &picture.notes {
            self.warn(&format!("{}: {note}", path.display()));
        }
        let (known, next) = (&mut self.layer.metadata, picture.metadata.of_colors());
        if !std::mem::replace(&mut self.told, true) {
            *known = next;
            return Ok(picture.image);
        }
        known.quality = known.quality.max(next.quality);
        known.half &= next.half;
        if known.icc != next.icc {
            known.icc = None;
            self.warn(&format!(
                "the pictures of {} have different colour profiles: none is written, and colours may look different",
                self.layer.role
            ));
        }
        Ok(picture.image)
    }

    fn push(&mut self, image: Image, placement: Placement) -> u32 {
        self.layer.images.push(image);
        self.layer.placements.push(placement);
        self.layer.images.len() as u32 - 1
    }

    /// What material `m` shows in the layer's role: its picture times its factors, or its colour.
    fn add_appearance(&mut self, appearance: &Appearance<'_>, m: usize) -> Result<()> {
        let material = &self.source.materials[m];
        let role = self.layer.role.clone();
        let Some((content, placement)) = appearance.picture(m, &role) else {
            if let Some(colour) = appearance.colour(m, &role)? {
                let k = self.push(colour, Placement::default());
                self.show(m as u32, k);
            }
            return Ok(());
        };
        if let Some(name) = appearance::tiles(&content) {
            if placement != Placement::default() {
                let name = name.text();
                self.warn(&format!(
                    "{name}: tiles lie on the texture coordinates as they are; other placements are passed over"
                ));
            }
            return self.add(&name, |k| k == m as u32);
        }
        let known = match &content {
            TextureContent::File(path) => self.known.iter().find(|(p, placed, _)| p == path && *placed == placement),
            TextureContent::Embedded(_) => None,
        };
        let k = match known {
            Some((.., k)) => *k,
            None => {
                let mut image = match &content {
                    TextureContent::File(path) => self.read(path)?,
                    TextureContent::Embedded(_) => appearance::read(&content, self.source)?,
                };
                let multiplied = appearance::multiply(&mut image, &role, material)?;
                let k = self.push(image, placement);
                if let (TextureContent::File(path), false) = (content, multiplied) {
                    self.known.push((path, placement, k));
                }
                k
            }
        };
        self.show(m as u32, k);
        Ok(())
    }

    /// Lets material `m` show picture `k`.
    fn show(&mut self, m: u32, k: u32) {
        self.layer.material_texture[m as usize] = k;
        let source = self.source;
        if let Some(faces) = &mut self.layer.face_texture {
            let shown = faces.iter_mut().enumerate().filter(|(t, _)| source.triangle_material(*t) == m);
            shown.for_each(|(_, f)| *f = k);
        }
    }

    /// How the picture of material `m` lies in the layer's role, by its own texture in that role.
    fn placement(&self, m: u32) -> Placement {
        self.source.materials.get(m as usize).map_or_else(Placement::default, |m| m.placement(&self.layer.role))
    }

    /// Reads a picture, or the tiles of one, for the materials that `wanted` names ([`NONE`]: triangles without).
    fn add(&mut self, name: &TextureName, wanted: impl Fn(u32) -> bool) -> Result<()> {
        let source = self.source;
        let shown = |t: usize| wanted(source.triangle_material(t));
        let used = TilesUsed::of(source, shown);
        if !name.has_tile() {
            for m in (0..source.materials.len() as u32).filter(|&m| wanted(m)) {
                let placement = self.placement(m);
                let picture = self.picture(PathBuf::from(name.text()), placement)?;
                self.show(m, picture);
                if !placement.keeps_coordinates() {
                    let material = &source.materials[m as usize].name;
                    self.warn(&format!("{} lies as material {material:?} says of its own texture", name.text()));
                }
            }
            if wanted(NONE) {
                self.layer.default_texture = self.picture(PathBuf::from(name.text()), Placement::default())?;
                let default = self.layer.default_texture;
                if let Some(faces) = &mut self.layer.face_texture {
                    let bare = faces.iter_mut().enumerate().filter(|(t, _)| source.triangle_material(*t) == NONE);
                    bare.for_each(|(_, f)| *f = default);
                }
            }
            if used.beyond_the_unit_square() {
                self.warn(&format!(
                    "{}: texture coordinates leave the unit square, where {} repeats; name one file a tile with <UDIM>",
                    source.name,
                    name.text()
                ));
            }
            return Ok(());
        }
        let mut pictures: BTreeMap<UvTile, u32> = BTreeMap::new();
        let mut missing = Vec::new();
        for (&tile, &triangles) in &used.tiles {
            let path = name.file(Some(tile.corner()), &self.layer.role, "");
            if path.exists() {
                pictures.insert(tile, self.picture(path, Placement::default())?);
            } else {
                missing.push((tile, triangles, path));
            }
        }
        if let (true, Some((_, _, path))) = (pictures.is_empty(), missing.first()) {
            let found =
                std::io::Error::new(std::io::ErrorKind::NotFound, "none of the tiles that the source uses exists");
            return Err(Error::io(
                path,
                found,
                "Check the name before <UDIM>, and the texture coordinates of the source",
            ));
        }
        self.tile_notes(name, &used, &missing);
        let mut faces = self.layer.face_texture.take().unwrap_or_else(|| self.layer.of_faces(source));
        for (t, face) in faces.iter_mut().enumerate().filter(|(t, _)| shown(*t)) {
            let tile = source.triangle_texcoords(t).map(|uv| UvTile::of(&uv));
            *face = tile.and_then(|tile| pictures.get(&tile).copied()).unwrap_or(NONE);
        }
        self.layer.face_texture = Some(faces);
        Ok(())
    }

    fn tile_notes(&self, name: &TextureName, used: &TilesUsed, missing: &[(UvTile, u64, PathBuf)]) {
        let name = name.text();
        if !missing.is_empty() {
            let tiles: Vec<String> =
                missing.iter().filter_map(|(tile, ..)| tile.udim()).map(|n| n.to_string()).collect();
            let triangles: u64 = missing.iter().map(|m| m.1).sum();
            self.warn(&format!(
                "{name}: no file for the tiles {}; {triangles} triangles of the source have no {} there",
                tiles.join(", "),
                self.layer.role
            ));
        }
        let source = &self.source.name;
        if let (n @ 1.., t) = used.unnumbered {
            self.warn(&format!(
                "{source}: {n} triangles lie in squares that have no UDIM number, first {t}; they have no texture"
            ));
        }
        if let (n @ 1.., t) = used.crossing {
            self.warn(&format!(
                "{source}: {n} triangles reach over the border of a tile, first {t}; they show the one of their centre"
            ));
        }
    }

    /// The layer, with a note on materials that it leaves out.
    fn finish(self) -> Result<Textures> {
        let faces = match &self.layer.face_texture {
            Some(faces) => faces.clone(),
            None => self.layer.of_faces(self.source),
        };
        let mut without: BTreeMap<u32, u64> = BTreeMap::new();
        let mut with = BTreeSet::new();
        for (t, face) in faces.iter().enumerate() {
            let material = self.source.triangle_material(t);
            if *face == NONE {
                *without.entry(material).or_insert(0) += 1;
            } else {
                with.insert(material);
            }
        }
        if with.is_empty() {
            let undefined = without.keys().find_map(|&m| self.source.materials.get(m as usize));
            let what = match undefined {
                Some(m) => format!(
                    "{}: material {:?} and all others that faces show have no {}",
                    self.source.name, m.name, self.layer.role
                ),
                None => format!("{}: its faces have no material, and so no {}", self.source.name, self.layer.role),
            };
            return Err(usage("--texture", &what, "Name a picture with --texture FILE, or mend the material library"));
        }
        without.retain(|m, _| !with.contains(m));
        if !without.is_empty() {
            let name = |m: u32| self.source.materials.get(m as usize).map_or("(no material)", |m| m.name.as_str());
            let names: Vec<&str> = without.keys().take(20).map(|&m| name(m)).collect();
            let triangles: u64 = without.values().sum();
            self.warn(&format!(
                "{}: no {} for the materials {}; what is mapped to their {triangles} triangles gets no colour",
                self.source.name,
                self.layer.role,
                names.join(", ")
            ));
        }
        Ok(self.layer)
    }
}
