//! Every kernel on a device beside its reference: the first thing to run on a new device
//! (`barymap devices --check`).
//!
//! All data are generated, so that the program is all that is needed. A [`Check`] gives one number,
//! the error of the device, and the largest error that passes; both have the unit that it names.
//! Errors are taken against double precision where that is at hand, else against the same job on
//! the CPU in single precision.

mod encoding;
mod patterns;
mod plane;
mod scene;
mod space;
mod surface;
mod textures;
mod warp;

use std::time::Duration;

use web_time::Instant;

use crate::engine::{Engine, Gpu, Kernel, reflect};
use crate::error::Result;

pub use scene::{Scene, Surface};
#[doc(hidden)]
pub use surface::MOST_APART;

/// One comparison of a device with its reference.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// What is compared.
    pub name: &'static str,
    /// The kernels that run.
    pub kernels: &'static [&'static str],
    /// The unit of errors.
    pub unit: &'static str,
    /// The largest error that passes.
    pub tolerance: f64,
    measure: fn(&Engine) -> Result<Outcome>,
}

/// The result of a [`Check`] on one device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// The error of the device; infinite where the results cannot be compared.
    pub error: f64,
    /// Whether two runs gave the same bytes.
    pub repeats: bool,
    /// Wall time on the device: the faster of two runs, so that no kernel is compiled in it.
    pub device: Duration,
    /// Wall time of the same job on the CPU in single precision, on all its threads.
    pub cpu: Duration,
}

impl Check {
    /// Runs the job on the device of `engine` and on the CPU.
    ///
    /// # Errors
    /// Those of the device; [`Error::Capability`](crate::Error::Capability) for an engine without
    /// one.
    pub fn run(&self, engine: &Engine) -> Result<Outcome> {
        device(engine)?;
        (self.measure)(engine)
    }

    /// Whether an outcome is within the tolerance and the same on every run.
    pub fn passes(&self, outcome: &Outcome) -> bool {
        outcome.error <= self.tolerance && outcome.repeats
    }
}

/// All checks, those of single stages before those of whole jobs.
pub fn checks() -> Vec<Check> {
    [patterns::CHECKS, plane::CHECKS, space::CHECKS, surface::CHECKS, encoding::CHECKS, textures::CHECKS, warp::CHECKS]
        .concat()
}

/// All kernels of the library.
pub fn kernels() -> Vec<&'static Kernel> {
    [
        crate::encoding::gpu::KERNELS,
        crate::engine::KERNELS,
        crate::mapping::plane::gpu::KERNELS,
        crate::mapping::space::gpu::KERNELS,
        crate::surface::gpu::KERNELS,
        crate::tools::transfer::gpu::KERNELS,
        crate::tools::warp::gpu::KERNELS,
    ]
    .concat()
}

/// Everything wrong with a kernel on a device, one sentence each: naga validates its text against
/// its host half, then the driver compiles it.
pub fn faults(kernel: &'static Kernel, gpu: &Gpu) -> Vec<String> {
    let mut found = reflect::faults(kernel);
    if found.is_empty() {
        found.extend(gpu.pipeline(kernel).err().map(|e| e.to_string()));
    }
    found
}

/// The device of an engine.
fn device(engine: &Engine) -> Result<&Gpu> {
    engine.gpu().ok_or_else(|| crate::Error::Capability {
        limit: "devices to check the kernels on".into(),
        required: 1,
        actual: 0,
    })
}

/// A job's result with the seconds of its faster run, and whether both runs agree.
struct Timed<T> {
    value: T,
    wall: Duration,
    repeats: bool,
}

/// Runs a job twice: the first run compiles kernels and finds out their pace.
fn timed<T: PartialEq>(mut job: impl FnMut() -> Result<T>) -> Result<Timed<T>> {
    let clock = Instant::now();
    let first = job()?;
    let wall = clock.elapsed();
    let clock = Instant::now();
    let value = job()?;
    Ok(Timed { repeats: first == value, wall: wall.min(clock.elapsed()), value })
}

/// The outcome of a job with an error.
fn outcome<T, U>(device: &Timed<T>, cpu: &Timed<U>, error: f64) -> Outcome {
    Outcome { error, repeats: device.repeats, device: device.wall, cpu: cpu.wall }
}

/// The largest of some differences; NaN counts as infinite.
fn largest(differences: impl Iterator<Item = f64>) -> f64 {
    differences.fold(0.0, |m, d| if d.is_nan() { f64::INFINITY } else { m.max(d) })
}

/// The difference that `part` of the values do not exceed.
fn quantile(mut differences: Vec<f64>, part: f64) -> f64 {
    differences.sort_by(f64::total_cmp);
    let last = differences.len().saturating_sub(1) as f64;
    differences.get((last * part).ceil() as usize).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outcome_passes_within_the_tolerance_and_if_it_repeats() {
        let check = patterns::CHECKS[0];
        let good = Outcome { error: check.tolerance, repeats: true, device: Duration::ZERO, cpu: Duration::ZERO };
        assert!(check.passes(&good));
        assert!(!check.passes(&Outcome { repeats: false, ..good }));
        assert!(!check.passes(&Outcome { error: check.tolerance + 1.0, ..good }));
        assert!(!check.passes(&Outcome { error: f64::NAN, ..good }));
    }

    #[test]
    fn differences_that_are_no_numbers_fail() {
        assert_eq!(largest([0.5, 2.0, 1.0].into_iter()), 2.0);
        assert_eq!(largest([0.5, f64::NAN, 1.0].into_iter()), f64::INFINITY);
        assert_eq!(quantile(vec![3.0, 1.0, 2.0], 1.0), 3.0);
        assert_eq!(quantile((0..=100).map(f64::from).collect(), 0.99), 99.0);
        assert_eq!(quantile(vec![0.0, f64::NAN], 1.0).to_bits(), f64::NAN.to_bits());
        assert_eq!(quantile(Vec::new(), 0.99), f64::INFINITY);
    }

    #[test]
    fn every_kernel_has_a_check_and_every_check_a_kernel() {
        let mut named: Vec<&str> = checks().iter().flat_map(|c| c.kernels).copied().collect();
        // It runs whenever an engine starts.
        named.push("canary");
        named.sort_unstable();
        named.dedup();
        let mut all: Vec<&str> = kernels().iter().map(|k| k.name).collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(named, all);
    }

    #[test]
    fn an_engine_without_a_device_is_refused() {
        for check in checks() {
            assert!(check.run(&Engine::cpu()).is_err(), "{}", check.name);
        }
    }
}
