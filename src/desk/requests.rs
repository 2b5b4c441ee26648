//! Which textures of the source are transferred: those that are asked for by role and material, or
//! those that its materials name.

use std::collections::BTreeSet;
use std::path::Path;

use super::appearance::Appearance;
use super::layer_reader::Reader;
use super::textures::Textures;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::geometry::material::{BASE_COLOR, ROLES};
use crate::io::TextureName;
use crate::tools::transfer::holds_normals;

/// What a request says for the colours of vertices, in both spellings.
const VERTEX_COLORS: [&str; 2] = ["vertex-colors", "vertex-colours"];

/// One request.
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
                Err(Error::option(
                    "texture",
                    format!("{left:?} is neither a material of {} nor a role", source.name),
                    format!(
                        "Write FILE, MATERIAL=FILE, ROLE=FILE or ROLE:MATERIAL=FILE. Its materials: {materials}. Roles: {}; others as ROLE:*=FILE",
                        ROLES.join(", ")
                    ),
                ))
            }
        }
    }
}

/// The layers that `texts` ask for, each `FILE`, `MATERIAL=FILE`, `ROLE=FILE` or
/// `ROLE:MATERIAL=FILE`, with `vertex-colors` as a file for the colours of vertices; without texts
/// those of the source's materials, in all roles if `all_roles`. `tell` gets sentences for the
/// user.
///
/// # Errors
/// [`Error::Option`] for a text that names nothing of the source, or names something twice; what
/// reading a picture returns.
pub fn textures(texts: &[String], all_roles: bool, mesh: &Mesh, tell: &dyn Fn(&str)) -> Result<Vec<Textures>> {
    if texts.is_empty() {
        return materials_textures(mesh, all_roles, tell);
    }
    let requests: Vec<Request> = texts.iter().map(|t| Request::parse(t, mesh)).collect::<Result<_>>()?;
    let plain = requests.iter().filter(|r| r.role.is_none() && r.material.is_none()).count();
    let bare = requests.iter().filter(|r| r.role.is_none() && r.material.is_some()).count();
    if plain > 0 && bare > 0 {
        return Err(Error::option(
            "texture",
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
                return Err(Error::option("texture", what, "Give each once, or put a role before it: ROLE=FILE"));
            }
            Some((_, known)) => known.push(request),
            None => layers.push((role, vec![request])),
        }
    }
    layers.iter().map(|(role, requests)| layer(role, requests, mesh, tell)).collect()
}

fn layer(role: &str, requests: &[Request], source: &Mesh, tell: &dyn Fn(&str)) -> Result<Textures> {
    if requests.iter().any(|r| VERTEX_COLORS.contains(&r.name.text())) {
        if let [Request { material: None, .. }] = requests {
            return Textures::of_vertices(role, source);
        }
        let what = "vertex colours are those of all materials";
        return Err(Error::option("texture", what, "Give vertex-colors alone for its role, without a material"));
    }
    let mut reader = Reader::new(Textures::empty(role, source), source, tell);
    let named: BTreeSet<u32> = requests.iter().flat_map(|r| reader.materials(r.material.as_deref())).collect();
    for request in requests {
        let materials = reader.materials(request.material.as_deref());
        let rest = request.material.is_none();
        let wanted = |m: u32| if rest { !named.contains(&m) } else { materials.contains(&m) };
        reader.add(&request.name, wanted)?;
    }
    if role == "height" && reader.layer.images.iter().any(holds_normals) {
        tell("the height texture looks like a normal map; if it is one, give it as normal=FILE");
    }
    reader.finish()
}

/// What the source's own materials show as base colour; the colours of its vertices where they name
/// no picture.
///
/// # Errors
/// [`Error::Option`] if they show nothing; what reading a picture returns.
pub fn own_textures(source: &Mesh) -> Result<Textures> {
    let layers = materials_textures(source, false, &|_| ())?;
    layers.into_iter().next().ok_or_else(|| none(source))
}

fn none(source: &Mesh) -> Error {
    Error::option("texture", format!("{} names no texture", source.name), "Name a picture")
}

fn materials_textures(source: &Mesh, all_roles: bool, tell: &dyn Fn(&str)) -> Result<Vec<Textures>> {
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
        let mut reader = Reader::new(Textures::empty(role, source), source, tell);
        reader.layer.multiplied = true;
        let mut add = || appearance.used().try_for_each(|m| reader.add_appearance(&appearance, m));
        match add() {
            Ok(()) => layers.push(reader.finish()?),
            // The base colour is what is asked for; of the rest what can be read comes along.
            Err(error) if role != BASE_COLOR => tell(&format!("{role} is left out: {error}")),
            Err(error) => return Err(error),
        }
    }
    if layers.is_empty() { Err(none(source)) } else { Ok(layers) }
}
