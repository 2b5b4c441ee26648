//! The path is simple all the way, whatever the polygons.

use std::f64::consts::PI;

use glam::dvec2;

use super::*;
use crate::mapping::plane::path::{Intrinsic, Linear, polygon_at};
use crate::mapping::plane::random_polygons::{Kind, cage, cage_with_holes, ring};
use crate::mapping::plane::testing::{Random, nested_squares, pairs};

fn of(source: &Polygon, target: &Polygon) -> Cage {
    Cage::new(source.loops().to_vec(), target.loops().to_vec()).unwrap()
}

/// How many of the polygons at k / 32 are refused.
fn refused(path: &dyn VertexPath, cage: &Cage) -> usize {
    let nesting = cage.source.nesting().unwrap();
    (0..=32).filter(|&k| polygon_at(path, f64::from(k) / 32.0, &nesting).is_err()).count()
}

#[test]
fn polygons_on_the_way_are_simple_where_the_other_paths_are_not() {
    let kinds = [Kind::Star, Kind::Tour, Kind::Growth];
    let mut random = Random(23);
    let (mut intrinsic, mut linear) = (0, 0);
    for trial in 0..36 {
        let n = 5 + (random.unit() * 60.0) as usize;
        let cage = cage(kinds[trial % 3], kinds[trial / 3 % 3], n, &mut random);
        assert_eq!(refused(&Compatible::new(&cage).unwrap(), &cage), 0, "{trial}");
        intrinsic += usize::from(refused(&Intrinsic::new(&cage), &cage) > 0);
        linear += usize::from(refused(&Linear::new(&cage), &cage) > 0);
    }
    assert!(intrinsic > 10 && linear > 20, "{intrinsic} {linear}: the pairs are hard ones");
}

#[test]
fn holes_keep_their_places() {
    let mut random = Random(4);
    for trial in 0..12 {
        let kind = [Kind::Star, Kind::Tour, Kind::Growth][trial % 3];
        let cage = cage_with_holes(kind, 6 + 3 * trial, 1 + trial % 4, &mut random);
        assert_eq!(refused(&Compatible::new(&cage).unwrap(), &cage), 0, "{trial}");
    }
    // An island in a hole, that goes to the other side of it; and loops that turn against one
    // another.
    let square = |x: f64, y: f64, half: f64, turn: f64| -> Vec<DVec2> {
        (0..4).map(|k| dvec2(x, y) + DVec2::from_angle(turn + PI / 2.0 * f64::from(k)) * half).collect()
    };
    let hole = |x: f64, turn: f64| square(x, 0.0, 0.7, turn).into_iter().rev().collect::<Vec<_>>();
    let source = vec![square(0.0, 0.0, 2.0, 0.0), hole(0.0, 0.0), square(-0.3, 0.0, 0.3, 0.0)];
    let target = vec![square(0.0, 0.0, 2.0, 0.0), hole(0.2, 1.5), square(0.5, 0.0, 0.3, 3.0)];
    let cage = Cage::new(source, target).unwrap();
    assert_eq!(refused(&Compatible::new(&cage).unwrap(), &cage), 0);
    let turned = of(&nested_squares(0.0), &nested_squares(1.0));
    assert_eq!(refused(&Compatible::new(&turned).unwrap(), &turned), 0);
}

#[test]
fn the_ends_are_met_and_the_way_there_is_continuous() {
    for (name, source, target) in pairs() {
        let cage = of(&source, &target);
        let path = Compatible::new(&cage).unwrap();
        assert_eq!(path.polygon(0.0).unwrap(), cage.source);
        assert_eq!(path.polygon(1.0).unwrap(), cage.target);
        for (t, end) in [(1e-9, &cage.source), (1.0 - 1e-9, &cage.target)] {
            let near = path.polygon(t).unwrap();
            assert!(near.vertices().zip(end.vertices()).all(|(p, q)| (p - q).length() < 1e-6), "{name}");
        }
        let half = path.polygon(0.5).unwrap();
        assert!((half.area() - (source.area() + target.area()) / 2.0).abs() < 1e-12);
        assert!((half.barycentre() - (source.barycentre() + target.barycentre()) / 2.0).length() < 1e-12);
    }
}

#[test]
fn similar_polygons_stay_similar() {
    // No four vertices on a circle: both drawings have the same triangulation.
    let star = Polygon::from_loops(vec![ring(Kind::Star, 20, &mut Random(1))]);
    let moved = |v: DVec2, part: f64| {
        DVec2::from_angle(2.5 * part).rotate(v) * (1.0 - part + part * 9.0).sqrt() + dvec2(5.0, -7.0) * part
    };
    let placed = |part: f64| star.vertices().map(|v| moved(v, part)).collect::<Vec<_>>();
    let centre = star.barycentre();
    let path = Compatible::new(&Cage::new(vec![placed(0.0)], vec![placed(1.0)]).unwrap()).unwrap();
    for t in [0.25, 0.5, 0.75] {
        // About the barycentre the star only turns and grows.
        let here = path.polygon(t).unwrap();
        for (p, v) in here.vertices().zip(star.vertices()) {
            let expected = moved(v, t) - moved(centre, t);
            assert!((p - here.barycentre() - expected).length() < 1e-9);
        }
    }
}

#[test]
fn what_is_too_much_is_refused() {
    let ring = |wave: f64| -> Vec<DVec2> {
        let n = MOST_VERTICES + 1;
        (0..n)
            .map(|k| PI * 2.0 * k as f64 / n as f64)
            .map(|a| DVec2::from_angle(a) * (1.0 + wave * (40.0 * a).sin()))
            .collect()
    };
    let cage = Cage::new(vec![ring(0.0)], vec![ring(0.2)]).unwrap();
    assert!(Compatible::new(&cage).unwrap_err().to_string().contains("2049 vertices are more than 2048"));
}

#[test]
fn a_triangle_that_is_turned_over_is_noticed() {
    // Two drawings of a frame with one vertex in it; in the second the vertex is outside.
    let frame = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| dvec2(x, y));
    let drawing = |x: f64| frame.into_iter().chain([dvec2(x, 0.0)]).collect::<Vec<_>>();
    let triangles = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let system = System::new(&[drawing(0.1), drawing(-0.5)], &triangles, 4).unwrap();
    assert!((system.solve(0.0).unwrap()[4] - dvec2(0.1, 0.0)).length() < 1e-12);
    assert!((system.solve(1.0).unwrap()[4] - dvec2(-0.5, 0.0)).length() < 1e-12);
    assert!(System::new(&[drawing(0.1), drawing(1.5)], &triangles, 4).is_none());
}
