//! Live transfers: what follows an edit is what a whole transfer gives.

use barymap::Error;
use barymap::geometry::{Mesh, NONE, Topology};
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::Shape;
use barymap::surface::field::{Edit, FieldOptions, FieldPair, FieldSession};
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions, PointMap, Status};
use barymap::tools::transfer::{Fill, Layer, LayerKind, LiveTransfer, TransferOptions, TransferOutput, transfer};
use glam::DVec2;

use super::grid;
use super::whole::{Identity, Planar, noise, options};

fn same(live: &LiveTransfer<'_>, whole: &TransferOutput) -> bool {
    live.layers().eq(&whole.layers) && live.coverage() == whole.coverage
}

/// Swirls what is near the middle, by an angle; inside `hole` of it nothing is found.
fn swirl(angle: f64, hole: f64) -> impl Fn(DVec2) -> (DVec2, Status) + Sync {
    move |p| {
        let d = p - DVec2::splat(0.5);
        let reach = (1.0 - d.length() / 0.3).max(0.0);
        let status = if d.length() < hole { Status::Failed } else { Status::Valid };
        (DVec2::splat(0.5) + DVec2::from_angle(angle * reach).rotate(d), status)
    }
}

fn near_the_middle(mesh: &Mesh) -> Vec<u32> {
    let near = |t: &u32| mesh.triangle_positions(*t as usize).iter().any(|p| (p.truncate() - 0.5).length() < 0.45);
    (0..mesh.triangle_count() as u32).filter(near).collect()
}

#[test]
fn it_is_a_whole_transfer_after_every_update() {
    let mesh = grid(12, 0.4, 3);
    let (colors, labels) = (noise(96, 64, 3, 1), noise(80, 80, 1, 2));
    let label = Layer { kind: LayerKind::Labels, ..Layer::single("labels", &labels) };
    let layers = [Layer::single("colour", &colors), label];
    let options = TransferOptions { margin: 5, ..options(100, 90) };
    let map = |angle, hole| Planar { source: &mesh, target: &mesh, function: swirl(angle, hole) };
    let whole = |map: &dyn PointMap| transfer(&mesh, &layers, &mesh, map, &options, &Quiet).expect("transfer");
    let mut live = LiveTransfer::new(&mesh, &layers, &mesh, &map(0.0, 0.0), &options).expect("live");
    assert!(same(&live, &whole(&map(0.0, 0.0))));
    let triangles = near_the_middle(&mesh);
    // Turned, with a hole that opens and closes again: its border is padded anew.
    for (angle, hole) in [(1.0, 0.0), (1.0, 0.1), (-0.5, 0.05), (0.2, 0.0)] {
        let followed = live.update(&map(angle, hole), &triangles).expect("update");
        assert!(same(&live, &whole(&map(angle, hole))), "{angle} {hole}");
        assert!(followed.mapped < 100 * 90 && followed.recolored < followed.mapped, "{followed:?}");
        let tile = followed.changed.expect("something changed");
        assert!(tile.x > 10 && tile.y > 10 && tile.width < 80 && tile.height < 80, "{tile:?}");
    }
    // The comparison does notice what was not told, and nothing is done where nothing changed.
    let untold = live.update(&map(0.8, 0.0), &triangles[..3]).expect("update");
    assert!(!same(&live, &whole(&map(0.8, 0.0))) && untold.recolored < 500);
    live.update(&map(0.8, 0.0), &triangles).expect("update");
    let again = live.update(&map(0.8, 0.0), &triangles).expect("update");
    assert!(same(&live, &whole(&map(0.8, 0.0))));
    assert_eq!((again.recolored, again.padded, again.changed), (0, 0, None));
}

#[test]
fn a_budget_leaves_the_rest_to_later_calls() {
    let mesh = grid(12, 0.4, 3);
    let colors = noise(96, 64, 3, 1);
    let layers = [Layer::single("colour", &colors)];
    let options = TransferOptions { margin: 5, ..options(100, 90) };
    let map = |angle, hole| Planar { source: &mesh, target: &mesh, function: swirl(angle, hole) };
    let whole = |map: &dyn PointMap| transfer(&mesh, &layers, &mesh, map, &options, &Quiet).expect("transfer");
    let mut live = LiveTransfer::new(&mesh, &layers, &mesh, &map(0.0, 0.0), &options).expect("live");
    let triangles = near_the_middle(&mesh);
    // A second edit comes before the first is done.
    let first = live.follow(&map(1.0, 0.1), &triangles, 500).expect("follow");
    assert!(first.mapped == 500 && first.left > 1000, "{first:?}");
    let mut done = live.follow(&map(-0.5, 0.05), &triangles, 700).expect("follow");
    assert!(!same(&live, &whole(&map(-0.5, 0.05))), "the comparison notices what is left");
    let mut calls = 1;
    while done.left > 0 {
        let before = done.left;
        done = live.follow(&map(-0.5, 0.05), &[], 700).expect("follow");
        assert_eq!(done.left, before.saturating_sub(700));
        calls += 1;
    }
    assert!(calls > 3 && same(&live, &whole(&map(-0.5, 0.05))), "{calls} calls");
}

#[test]
fn what_cannot_follow_is_refused() {
    let mesh = grid(2, 0.0, 1);
    let image = noise(4, 4, 3, 1);
    let color = [Layer::single("colour", &image)];
    let new = |layers: &[Layer<'_>], o: TransferOptions| LiveTransfer::new(&mesh, layers, &mesh, &Identity, &o).err();
    let base = options(8, 8);
    assert!(new(&color, base.clone()).is_none());
    for bad in [
        TransferOptions { supersample: 2, ..base.clone() },
        TransferOptions { fill: Fill::PullPush, ..base.clone() },
        TransferOptions { coordinates: true, ..base.clone() },
    ] {
        assert!(matches!(new(&color, bad), Some(Error::Option { .. })));
    }
    let heights = Layer { kind: LayerKind::displacement(), ..Layer::single("heights", &image) };
    assert!(matches!(new(&[heights], base.clone()), Some(Error::Option { .. })));
    let little = TransferOptions { memory: 1 << 12, ..base.clone() };
    assert!(matches!(new(&color, little), Some(Error::Memory { .. })));
    let mut live = LiveTransfer::new(&mesh, &color, &mesh, &Identity, &base).expect("live");
    assert!(matches!(live.update(&Identity, &[0, 8]), Err(Error::Input { .. })));
    assert!(matches!(live.update(&Identity, &[NONE]), Err(Error::Input { .. })));
}

/// Fig. 13 of the surface paper: one mesh, anchors on it, one of them moved; the texture follows
/// there and nowhere else.
#[test]
fn a_moved_anchor_pulls_the_texture_along() {
    let pair = barymap::models::character_pair();
    let mesh = &pair.source.mesh;
    let topology = Topology::new(mesh);
    let embedding =
        Embedding::compute(mesh, &topology, &EmbeddingOptions { landmarks: 200, ..Default::default() }, &Quiet)
            .expect("embedding");
    let shape = Shape { mesh, topology: &topology, embedding: Some(&embedding) };
    let (points, _) = pair.anchors(40);
    let anchors = AnchorPairs { source: points.clone(), target: points.clone() };
    let field = FieldPair::<8>::new(shape, shape).expect("pair");
    let mut session = FieldSession::<f32, 8, 12>::new(field, anchors, &FieldOptions::default()).expect("session");
    let image = noise(128, 128, 3, 4);
    let layers = [Layer::single("colour", &image)];
    let size = options(256, 256);
    let mut live = LiveTransfer::new(mesh, &layers, mesh, session.field(), &size).expect("live");
    let whole = |map: &dyn PointMap| transfer(mesh, &layers, mesh, map, &size, &Quiet).expect("transfer");
    // To the next vertex.
    let start = points[7];
    let corners = mesh.triangle(start.face as usize);
    let far = |v: u32| mesh.positions[v as usize].distance(start.position(mesh));
    let to = corners.into_iter().max_by(|a, b| far(*a).total_cmp(&far(*b))).expect("three corners");
    let there = vertex_point(mesh, &topology, to, "anchor").expect("point");
    let triangles = session.edit(&[Edit::Move(7, start, there)]).expect("edit");
    assert!(!triangles.is_empty() && triangles.len() < mesh.triangle_count(), "{}", triangles.len());
    let followed = live.update(session.field(), &triangles).expect("update");
    assert!(followed.recolored > 0, "{followed:?}");
    assert!(same(&live, &whole(session.field())), "other triangles changed, too");
    // What was painted at the anchor is now where the anchor went.
    let mut images = Vec::new();
    session.field().map(&[there.into()], &mut images).expect("map");
    let image = images[0].point().expect("an image").position(mesh);
    assert!(image.distance(start.position(mesh)) < 0.05 * far(to), "{image}");
}
