use glam::DVec3;

use super::*;
use crate::geometry::SurfacePoint;
use crate::geometry::{Mesh, Topology};
use crate::models::shapes::lobed_sphere;
use crate::surface::anchors::vertex_point;
use crate::surface::embedding::{Embedding, Seconds};

/// A mesh "embedded" by its own positions.
fn embedded(mesh: &Mesh) -> (Topology, Embedding) {
    let points: Vec<f64> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
    let embedding = Embedding {
        dimension: 8,
        points,
        landmarks: Vec::new(),
        stress: 0.0,
        sweeps: 0,
        seconds: Seconds::default(),
        warnings: Vec::new(),
    };
    (Topology::new(mesh), embedding)
}

fn pairs(source: &Mesh, target: &Mesh, vertices: &[u32]) -> AnchorPairs {
    let points = |mesh: &Mesh| {
        let topology = Topology::new(mesh);
        vertices.iter().map(|&v| vertex_point(mesh, &topology, v, "anchor").unwrap()).collect()
    };
    AnchorPairs { source: points(source), target: points(target) }
}

/// Distances between the images of all vertices and the source's vertices of the same number, over
/// the source's size, and the statuses.
fn errors(source: &Mesh, target: &Mesh, vertices: &[u32], relax: bool) -> (Vec<f64>, Vec<PackedImage>) {
    let ((st, se), (tt, te)) = (embedded(source), embedded(target));
    let shape = |mesh, topology, embedding| Shape { mesh, topology, embedding: Some(embedding) };
    let options = FieldOptions { relax, ..FieldOptions::default() };
    let anchors = pairs(source, target, vertices);
    let field =
        Field::<f64, 12>::new::<8>(shape(source, &st, &se), shape(target, &tt, &te), &anchors, &options).unwrap();
    let points: Vec<PackedPoint> =
        (0..target.vertex_count() as u32).map(|v| tt.vertex_point(v).unwrap().into()).collect();
    let mut images = Vec::new();
    field.map(&points, &mut images).unwrap();
    let unit = source.area().sqrt();
    let off =
        images.iter().zip(&source.positions).map(|(i, p)| i.point().unwrap().position(source).distance(*p) / unit);
    (off.collect(), images)
}

fn most(e: &[f64]) -> f64 {
    e.iter().copied().fold(0.0, f64::max)
}

#[test]
fn a_congruent_surface_is_met_exactly() {
    let target = lobed_sphere(3, 0.3);
    let mut source = target.clone();
    source.positions.iter_mut().for_each(|p| *p = DVec3::new(-p.y, p.x, p.z) * 3.0 + 1.0);
    let vertices: Vec<u32> = (0..target.vertex_count() as u32).step_by(29).collect();
    for relax in [false, true] {
        let (off, images) = errors(&source, &target, &vertices, relax);
        assert!(most(&off) < 1e-5, "{}", most(&off));
        assert!(images.iter().all(|i| i.status() == crate::surface::Status::Valid));
    }
    // A mirror image too.
    source.positions.iter_mut().for_each(|p| p.x = -p.x);
    assert!(most(&errors(&source, &target, &vertices, true).0) < 1e-5);
    // The measure can fail: two anchors exchanged.
    let mut wrong = vertices.clone();
    wrong.swap(2, 9);
    let (st, se) = embedded(&source);
    let (tt, te) = embedded(&target);
    let anchors = AnchorPairs {
        source: pairs(&source, &target, &wrong).source,
        target: pairs(&source, &target, &vertices).target,
    };
    let (s, t) = (
        Shape { mesh: &source, topology: &st, embedding: Some(&se) },
        Shape { mesh: &target, topology: &tt, embedding: Some(&te) },
    );
    let field = Field::<f64, 12>::new::<8>(s, t, &anchors, &FieldOptions::default()).unwrap();
    assert!(most(&field.report.left_out) > 0.1);
}

#[test]
fn anchors_stay_where_they_are_put_and_few_give_a_result() {
    let target = lobed_sphere(3, 0.3);
    let mut source = target.clone();
    source.positions.iter_mut().for_each(|p| *p *= 1.0 + 0.25 * (2.0 * p.x).sin());
    let vertices: Vec<u32> = (0..target.vertex_count() as u32).step_by(29).collect();
    let (off, _) = errors(&source, &target, &vertices, true);
    for &v in &vertices {
        assert!(off[v as usize] < 1e-5, "{v}: {}", off[v as usize]);
    }
    assert!(off.iter().sum::<f64>() / (off.len() as f64) < 0.03);
    for count in 1..=5 {
        let (off, images) = errors(&source, &target, &vertices[..count], true);
        assert!(off.iter().all(|e| e.is_finite()), "{count}");
        // Few anchors tell nothing of one another.
        assert!(count > 4 || images.iter().filter(|i| i.status() == crate::surface::Status::Valid).count() <= count);
    }
}

#[test]
fn edits_follow_and_settling_is_starting_anew() {
    let target = lobed_sphere(3, 0.3);
    let mut source = target.clone();
    source.positions.iter_mut().for_each(|p| *p *= 1.0 + 0.25 * (2.0 * p.x).sin());
    let vertices: Vec<u32> = (0..target.vertex_count() as u32).step_by(29).collect();
    let ((st, se), (tt, te)) = (embedded(&source), embedded(&target));
    let shape = |mesh, topology, embedding| Shape { mesh, topology, embedding: Some(embedding) };
    let pair = || FieldPair::<8>::new(shape(&source, &st, &se), shape(&target, &tt, &te)).unwrap();
    let options = FieldOptions::default();
    let whole = pairs(&source, &target, &vertices);
    let mut session = FieldSession::<f64, 8, 12>::new(pair(), whole.clone(), &options).unwrap();

    let unit = source.area().sqrt();
    let mean = |field: &Field<f64, 12>| {
        let image = |v: u32| field.map_point(tt.vertex_point(v).unwrap().into()).point().unwrap();
        let off = |v: u32| image(v).position(&source).distance(source.positions[v as usize]) / unit;
        (0..target.vertex_count() as u32).map(off).sum::<f64>() / target.vertex_count() as f64
    };
    let before = mean(session.field());
    // Nothing to do moves little, and a pair that is dragged away and back comes back.
    assert!(session.edit(&[]).unwrap().len() * 2 < target.triangle_count());
    let (s, t) = (whole.source[7], whole.target[7]);
    let away = source.triangles()[(s.face as usize + 40) % source.triangle_count()];
    let away = vertex_point(&source, &st, away[0], "away").unwrap();
    assert!(!session.edit(&[Edit::Move(7, away, t)]).unwrap().is_empty());
    let landed = session.field().map_point(t.into()).point().unwrap().position(&source);
    assert!(landed.distance(away.position(&source)) / unit < 1e-4);
    assert!(mean(session.field()) > before);
    session.edit(&[Edit::Move(7, s, t)]).unwrap();
    assert!(mean(session.field()) < 1.2 * before + 1e-4, "{} {before}", mean(session.field()));

    // Adding and removing; the last state settles to what these anchors give from the start.
    session.edit(&[Edit::Remove(3), Edit::Add(whole.source[3], whole.target[3])]).unwrap();
    assert_eq!(session.anchors().len(), whole.len());
    session.edit(&[Edit::Remove(0)]).unwrap();
    session.settle().unwrap();
    let fresh: Field<f64, 12> = pair().field(session.anchors(), &options).unwrap();
    assert_eq!(fresh.images(), session.field().images());
    assert_ne!(fresh.images(), pair().field::<f64, 12>(&whole, &options).unwrap().images());

    // What cannot be done changes nothing.
    let count = session.anchors().len();
    assert!(session.edit(&[Edit::Remove(count)]).is_err());
    let nowhere = SurfacePoint::new(1 << 30, [1.0, 0.0, 0.0]);
    assert!(session.edit(&[Edit::Remove(0), Edit::Add(nowhere, t)]).is_err());
    assert_eq!(session.anchors().len(), count);
}
