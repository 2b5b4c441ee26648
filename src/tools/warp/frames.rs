//! A warp as a sequence: the map cut off at times between source and target.

use crate::error::Error;
use crate::error::Result;
use crate::geometry::Polygon;
use crate::mapping::plane::path::polygon_at;
use crate::mapping::plane::{Cage, Partition};

/// The polygons of the map from the source to the polygon at `t` of the path: those of the
/// partition before `t`, then that one.
///
/// At 0 this is the identity, at 1 the whole map.
///
/// # Errors
/// [`Error::Numeric`] where the path has no valid polygon at `t`; [`Error::Option`] if `t` is not
/// in 0..=1.
pub fn cut(cage: &Cage, partition: &Partition, t: f64) -> Result<Vec<Polygon>> {
    if !(0.0..=1.0).contains(&t) {
        return Err(Error::option("frames", format!("there is no frame at {t}"), "Give a time from 0 to 1"));
    }
    let before = partition.knots.partition_point(|&knot| knot < t).max(1);
    let mut polygons = partition.polygons[..before].to_vec();
    let known = partition.knots.iter().position(|&knot| knot == t);
    let last = match known {
        Some(i) => partition.polygons[i].clone(),
        None => {
            let nesting =
                cage.source.nesting().map_err(|d| Error::input(d.to_string(), "Make the cage by Cage::new"))?;
            polygon_at(partition.route.as_ref(), t, &nesting)?
        }
    };
    polygons.push(last);
    Ok(polygons)
}

/// Times of `count` frames: from 0 to 1, both included; a single one is at 1.
pub fn times(count: u32) -> Vec<f64> {
    match count {
        0 => Vec::new(),
        1 => vec![1.0],
        _ => (0..count).map(|k| f64::from(k) / f64::from(count - 1)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Engine;
    use crate::mapping::plane::{CompositeMap, Coordinates, PartitionKind, PartitionOptions, PathKind, partition};
    use crate::progress::Quiet;
    use glam::DVec2;

    #[test]
    fn frames_lead_from_the_identity_to_the_map() {
        let square = |p: f64| vec![vec![DVec2::ZERO, DVec2::X, DVec2::splat(p), DVec2::Y]];
        let cage = Cage::new(square(1.0), square(0.3)).unwrap();
        let options =
            PartitionOptions { kind: PartitionKind::Uniform(4), path: PathKind::Linear, ..Default::default() };
        let whole = partition(&Engine::cpu(), &cage, &options, &Quiet).unwrap();
        let p = DVec2::new(0.7, 0.6);
        let at = |t: f64| CompositeMap::new(Coordinates::MeanValue, cut(&cage, &whole, t).unwrap()).unwrap();
        assert!(at(0.0).forward(p).point.distance(p) < 1e-12);
        let end = CompositeMap::new(Coordinates::MeanValue, whole.polygons.clone()).unwrap();
        assert_eq!(at(1.0).forward(p).point, end.forward(p).point);
        assert_eq!((at(0.5).step_count(), at(0.6).step_count(), at(1.0).step_count()), (2, 3, 4));
        let mut before = p;
        for t in times(21) {
            let now = at(t).forward(p).point;
            assert!(now.distance(before) < 0.06, "the path is continuous");
            before = now;
        }
        assert!(cut(&cage, &whole, 1.5).is_err());
        assert_eq!((times(0).len(), times(1), times(3)), (0, vec![1.0], vec![0.0, 0.5, 1.0]));
    }
}
