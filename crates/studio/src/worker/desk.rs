//! The worker's outer loop: files, textures, embeddings. It owns what the inner one borrows.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

use barymap::desk::{Subject, Textures, own_textures, textures};
use barymap::geometry::up_axis::stands_along_z;
use barymap::geometry::{ClosestPoints, Mesh, UpAxis};
use barymap::io::{Cache, ReadOptions};
use barymap::picture::{Depth, Image, Pixels};
use barymap::surface::EmbeddingOptions;
use barymap::surface::correspondence::Shape;
use barymap::tools::anchors::MirrorPlane;
use barymap::tools::unwrap::{UnwrapOptions, unwrap};
use barymap::{Error, Result};

use super::inbox::Inbox;
use super::message::{Drawn, OpenedShape, Report, Request, Rgba};
use super::progress::Reporter;
use super::soup::Soup;
use super::{Class, Out, live};
use crate::model::Side;
use crate::model::bvh::Bvh;

/// A shape whose mirror image is off by more than this part of the square root of its area is not
/// symmetric.
const SYMMETRIC: f64 = 0.01;
/// Sides of pictures that are drawn on the source at most.
const LARGEST_DRAWN: u32 = 2048;

/// What sessions borrow.
#[derive(Debug, Default)]
pub(crate) struct Owned {
    /// Source and target.
    pub(crate) subjects: [Option<Subject>; 2],
    /// The base colours of the source.
    pub(crate) textures: Option<Textures>,
    /// The target's texture coordinates as its file has them, while it has others.
    folded: Option<Mesh>,
    /// Planes of symmetry, once looked for.
    mirrors: [Option<Option<MirrorPlane>>; 2],
    /// Embeddings that failed are not tried again.
    hopeless: [bool; 2],
}

impl Owned {
    /// A shape, for the library.
    pub(crate) fn shape(&self, side: Side) -> Option<Shape<'_>> {
        self.subjects[side.index()].as_ref().map(Subject::shape)
    }

    /// Whether a shape could not be embedded.
    pub(crate) fn is_hopeless(&self) -> bool {
        self.hopeless.iter().zip(&self.subjects).any(|(h, s)| *h && s.as_ref().is_some_and(|s| s.embedding.is_none()))
    }
}

/// The thread: until the window says stop or is gone.
pub(crate) fn run(requests: Receiver<Request>, out: &Out) {
    let mut inbox = Inbox::new(requests, out.rested());
    let mut owned = Owned::default();
    let mut idle = false;
    while !inbox.stop {
        inbox.receive(idle);
        match step(&mut owned, &mut inbox, out) {
            Ok(more) => idle = !more,
            Err(Error::Cancelled) => idle = inbox.paused,
            Err(error) => {
                out.send(Report::Failed(error.to_string()));
                idle = false;
            }
        }
        if idle {
            out.send(Report::Idle);
        }
    }
}

/// Does one thing; whether there is more to do.
fn step(owned: &mut Owned, inbox: &mut Inbox, out: &Out) -> Result<bool> {
    for side in Side::BOTH {
        if let Some(path) = inbox.opens[side.index()].take() {
            match open(owned, out, side, &path) {
                Err(error) if !matches!(error, Error::Cancelled) => {
                    out.send(Report::Unopened(side, path, error.to_string()));
                    if side == Side::Source {
                        // The texture stays that of the mesh that is there.
                        inbox.texture = None;
                    }
                }
                other => other?,
            }
            return Ok(true);
        }
    }
    if let Some(path) = inbox.texture.take()
        && owned.subjects[0].is_some()
    {
        texture(owned, out, path.as_deref())?;
        return Ok(true);
    }
    if let Some(wanted) = inbox.unwrap.take()
        && owned.subjects[1].is_some()
    {
        fold(owned, out, wanted)?;
        return Ok(true);
    }
    if inbox.paused {
        return Ok(false);
    }
    for side in Side::BOTH {
        let k = side.index();
        let Some(subject) = &mut owned.subjects[k] else { continue };
        if subject.embedding.is_none() && !owned.hopeless[k] && inbox.method.needs_embedding() {
            // Where this fails, it fails again.
            owned.hopeless[k] = true;
            let result = embed(subject, out, side);
            if matches!(result, Err(Error::Cancelled)) {
                owned.hopeless[k] = false;
            }
            result?;
            return Ok(true);
        }
    }
    for side in Side::BOTH {
        let k = side.index();
        let Some(subject) = &owned.subjects[k] else { continue };
        if owned.mirrors[k].is_none() {
            let found = out.run(Class::Base, || true, || MirrorPlane::of(subject.shape()))?;
            let plane = found.filter(|p| p.off <= SYMMETRIC);
            owned.mirrors[k] = Some(plane);
            out.send(Report::Mirror(side, plane));
            return Ok(true);
        }
    }
    live::run(owned, inbox, out)
}

fn open(owned: &mut Owned, out: &Out, side: Side, path: &Path) -> Result<()> {
    let what = format!("opening {}", path.display());
    let _reporter = Reporter::new(out, &what);
    let opened = out.run(Class::Base, || true, || Subject::open(path, &ReadOptions::default()));
    let subject = opened?;
    let k = side.index();
    owned.mirrors[k] = None;
    owned.hopeless[k] = false;
    match side {
        Side::Source => owned.textures = None,
        Side::Target => owned.folded = None,
    }
    for note in &subject.notes {
        out.send(Report::Note(note.clone()));
    }
    show(out, side, path, &subject);
    owned.subjects[k] = Some(subject);
    if side == Side::Target {
        draw(owned, out, side)?;
    }
    Ok(())
}

fn show(out: &Out, side: Side, path: &Path, subject: &Subject) {
    let mesh = &subject.mesh;
    let shape = OpenedShape {
        path: path.to_path_buf(),
        bvh: Bvh::new(mesh),
        closest: ClosestPoints::new(mesh, &subject.topology),
        up: if stands_along_z(mesh) { UpAxis::Z } else { UpAxis::Y },
        has_texcoords: mesh.has_texcoords(),
        mesh: mesh.clone(),
    };
    out.send(Report::Opened(side, Arc::new(shape)));
}

/// Reads the textures of the source: its own, or a picture given by hand.
fn texture(owned: &mut Owned, out: &Out, path: Option<&Path>) -> Result<()> {
    let Some(subject) = &owned.subjects[0] else { return Ok(()) };
    let reporter = Reporter::new(out, "reading the texture");
    let tell = |text: &str| out.send(Report::Note(text.to_owned()));
    let mesh = &subject.mesh;
    let read = out.run(
        Class::Base,
        || true,
        || match path {
            Some(path) => {
                let name = path.to_string_lossy().into_owned();
                textures(&[name], false, mesh, &tell).map(|mut t| t.swap_remove(0))
            }
            None => own_textures(mesh),
        },
    );
    drop(reporter);
    owned.textures = match read {
        Ok(read) if read.needs_texcoords() && !mesh.has_texcoords() => {
            let what = "it has no texture coordinates, which its picture needs";
            out.send(Report::Failed(Error::mesh(&mesh.name, what, "Open a mesh with texture coordinates").to_string()));
            Some(by_place(mesh))
        }
        Ok(read) => Some(read),
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Err(error) => {
            if let Some(path) = path {
                out.send(Report::NoTexture(path.to_path_buf(), error.to_string()));
                return texture(owned, out, None);
            }
            out.send(Report::Note(format!("{error}. Colours show places until there is a texture")));
            Some(by_place(mesh))
        }
    };
    draw(owned, out, Side::Source)
}

/// Colours of vertices by where they are, for a source without a texture.
fn by_place(mesh: &Mesh) -> Textures {
    let (low, high) = mesh.bounds().unwrap_or_default();
    let size = (high - low).max(glam::DVec3::splat(f64::MIN_POSITIVE));
    let color = |p: &glam::DVec3| {
        let [r, g, b] = (0.15 + 0.75 * (*p - low) / size).as_vec3().to_array();
        [r, g, b, 1.0]
    };
    let vertices = Some(mesh.positions.iter().map(color).collect());
    let material_texture = vec![0; mesh.materials.len()];
    let none = Image { width: 0, height: 0, channels: 4, pixels: Pixels::U8(Vec::new()) };
    Textures { images: Vec::new(), vertices, material_texture, ..Textures::single(none) }
}

/// Sends a shape as it is to be drawn.
fn draw(owned: &Owned, out: &Out, side: Side) -> Result<()> {
    let Some(subject) = &owned.subjects[side.index()] else { return Ok(()) };
    let layer = owned.textures.as_ref().filter(|_| side == Side::Source);
    let pictured = layer.filter(|l| l.vertices.is_none());
    let soup = Arc::new(Soup::new(&subject.mesh, pictured));
    let pictures = pictured.map_or(Ok(Vec::new()), |l| l.images.iter().map(|i| drawn(i).map(Arc::new)).collect());
    let byte = |c: f32| (255.0 * c.clamp(0.0, 1.0)).round() as u8;
    let colors = layer.and_then(|l| l.vertices.as_ref()).map(|v| v.iter().map(|c| c.map(byte)).collect());
    out.send(Report::Drawn(side, Drawn { soup, pictures: pictures?, colors }));
    Ok(())
}

/// A picture in 8 bits, made smaller by whole factors where it is large.
fn drawn(image: &Image) -> Result<Rgba> {
    let mut picture = rgba(image)?;
    while picture.width.max(picture.height) > LARGEST_DRAWN {
        picture = halved(&picture);
    }
    Ok(picture)
}

/// A picture in 8 bits.
pub(crate) fn rgba(image: &Image) -> Result<Rgba> {
    let converted = image.converted(4, Depth::U8)?;
    let Pixels::U8(bytes) = converted.pixels else {
        return Err(Error::input("a picture that is not of 8 bits", "This is a fault of the studio"));
    };
    Ok(Rgba { width: image.width, height: image.height, bytes })
}

fn halved(p: &Rgba) -> Rgba {
    let (width, height) = ((p.width / 2).max(1), (p.height / 2).max(1));
    let at = |x: u32, y: u32, c: usize| {
        u32::from(p.bytes[4 * (y.min(p.height - 1) * p.width + x.min(p.width - 1)) as usize + c])
    };
    let mut bytes = Vec::with_capacity(4 * (width * height) as usize);
    for y in 0..height {
        for x in 0..width {
            for c in 0..4 {
                let sum = at(2 * x, 2 * y, c)
                    + at(2 * x + 1, 2 * y, c)
                    + at(2 * x, 2 * y + 1, c)
                    + at(2 * x + 1, 2 * y + 1, c);
                bytes.push((sum / 4) as u8);
            }
        }
    }
    Rgba { width, height, bytes }
}

/// Gives the target texture coordinates of our making, or those of its file back.
fn fold(owned: &mut Owned, out: &Out, wanted: bool) -> Result<()> {
    let Some(subject) = &mut owned.subjects[1] else { return Ok(()) };
    if wanted == owned.folded.is_some() {
        return Ok(());
    }
    if let Some(before) = owned.folded.take() {
        subject.mesh = before;
    } else {
        let reporter = Reporter::new(out, "making texture coordinates for the target");
        // As `barymap transfer --unwrap` with the default size and margin.
        let made =
            out.run(Class::Base, || true, || unwrap(&subject.mesh, &subject.topology, &UnwrapOptions::default()))?;
        drop(reporter);
        owned.folded = Some(std::mem::replace(&mut subject.mesh, made.mesh));
    }
    draw(owned, out, Side::Target)
}

fn embed(subject: &mut Subject, out: &Out, side: Side) -> Result<()> {
    let what = format!("measuring the {}", side.word());
    let reporter = Reporter::new(out, &what);
    let options = EmbeddingOptions::default();
    let notes = out.run(Class::Base, || true, || subject.embed(&options, &Cache::from_environment(), &reporter))?;
    notes.into_iter().for_each(|note| out.send(Report::Note(note)));
    Ok(())
}
