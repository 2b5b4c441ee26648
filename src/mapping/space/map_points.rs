//! Many points through the steps of a composite map in space (paper, sections 4.3 and 4.5).

use super::{Step, gpu};
use crate::engine::{Backend, Engine, Lanes};
use crate::error::Result;

/// Takes `points` through all `steps` in turn, in place: local coordinates of the first polyhedron
/// before, of the last one after.
///
/// Time O(faces) per point and step. On a device the steps ping-pong between two buffers; on the
/// CPU on SIMD lanes in parallel; the back end `reference` works in double precision between the
/// points it is given and those it returns.
///
/// # Errors
/// [`crate::Error::Device`] if the device fails, [`crate::Error::Memory`] past its budget.
pub fn map_points_3d(engine: &Engine, steps: &[Step<f64>], points: &mut [[f32; 3]]) -> Result<()> {
    if engine.backend() == Backend::Reference {
        let mut wide: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        steps.iter().for_each(|step| step.map_all(Lanes::scalar(), &mut wide));
        points.iter_mut().zip(wide).for_each(|(p, q)| *p = q.map(|x| x as f32));
        return Ok(());
    }
    if let Some(device) = engine.gpu_for("map_points_3d").filter(|_| steps.iter().all(gpu::fits)) {
        return gpu::map_on_device(device, steps, points);
    }
    steps.iter().for_each(|step| step.cast::<f32>().map_all(Lanes::detect(), points));
    Ok(())
}
