//! One mesh, anchors on it, some of them dragged: its texture follows, and only texels that moved
//! are made anew (Fig. 13 of Panozzo et al. 2013).
//!
//! `cargo run --release --example self_map [PICTURE.png]`

use std::error::Error;
use std::time::Instant;

use barymap::geometry::{ClosestPoints, Topology};
use barymap::io::write_image;
use barymap::models::character_pair;
use barymap::picture::Image;
use barymap::progress::Quiet;
use barymap::surface::correspondence::Shape;
use barymap::surface::field::{Edit, FieldOptions, FieldPair, FieldSession};
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions};
use barymap::tools::render::{Coloring, RenderOptions, render, side_by_side};
use barymap::tools::transfer::{Layer, LiveTransfer, TransferOptions};
use glam::DVec3;

const SIZE: u32 = 1024;
/// Steps of each drag.
const STEPS: usize = 8;

/// Straight lines along and around the body, which show how they are pulled.
fn lines(painted: &Image) -> barymap::Result<Image> {
    let line = |v: u32| v % 32 < 3;
    Image::from_fn(painted.width, painted.height, |x, y| {
        if line(x) || line(y) { [24, 24, 40, 255] } else { painted.pixel(x, y) }
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "self_map.png".into());
    let pair = character_pair();
    let mesh = &pair.source.mesh;
    let topology = Topology::new(mesh);
    let embedding = Embedding::compute(mesh, &topology, &EmbeddingOptions::default(), &Quiet)?;
    let shape = Shape { mesh, topology: &topology, embedding: Some(&embedding) };

    // Every anchor is its own image to begin with: the map is the identity.
    let (points, _) = pair.anchors(60);
    let anchors = AnchorPairs { source: points.clone(), target: points.clone() };
    let field = FieldPair::<8>::new(shape, shape)?;
    let mut session = FieldSession::<f32, 8, 12>::new(field, anchors, &FieldOptions::default())?;

    let texture = lines(&pair.source.texture(SIZE))?;
    let options = TransferOptions { width: SIZE, height: SIZE, ..TransferOptions::default() };
    let clock = Instant::now();
    let mut live = LiveTransfer::new(mesh, &[Layer::single("colour", &texture)], mesh, session.field(), &options)?;
    let whole = clock.elapsed().as_secs_f64();

    // Three anchors in front are dragged upwards: what is painted there goes along.
    let places: Vec<DVec3> = points.iter().map(|p| p.position(mesh)).collect();
    let (low, high) = places.iter().fold((places[0], places[0]), |(l, h), p| (l.min(*p), h.max(*p)));
    let front = DVec3::new((low.x + high.x) / 2.0, (low.y + 2.0 * high.y) / 3.0, high.z);
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|&i, &j| places[i].distance(front).total_cmp(&places[j].distance(front)));
    let surface = ClosestPoints::new(mesh, &topology);
    let up = DVec3::Y * (high.y - low.y) * 0.03;
    let (mut edits, mut seconds, mut texels) = (0, 0.0, 0);
    for &i in order.iter().step_by(2).take(3) {
        for step in 1..=STEPS {
            let at = places[i] + up * (step as f64 / STEPS as f64);
            let Some((to, _)) = surface.nearest(at) else { continue };
            let clock = Instant::now();
            let triangles = session.edit(&[Edit::Move(i, points[i], to)])?;
            let followed = live.update(session.field(), &triangles)?;
            seconds += clock.elapsed().as_secs_f64();
            edits += 1;
            texels += followed.recolored;
        }
    }
    println!(
        "the whole texture {:.0} ms; {edits} edits of {:.0} ms, {} texels each",
        1e3 * whole,
        1e3 * seconds / f64::from(edits.max(1)),
        texels / edits.max(1) as usize
    );

    let view = RenderOptions { width: 700, height: 900, ..RenderOptions::default() };
    let pulled = live.layers().next().ok_or("there is no layer")?;
    let before = render(mesh, Coloring::Texture(&texture), &points, &view)?;
    let after = render(mesh, Coloring::Texture(pulled), &session.anchors().target, &view)?;
    write_image(&side_by_side(&[before, after], 20, [255; 4])?, &output)?;
    println!("{output}: the texture as painted, and with three anchors dragged");
    Ok(())
}
