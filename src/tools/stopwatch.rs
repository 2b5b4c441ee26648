//! Wall and processor time by stage, and where it ran.

use std::time::Instant;

use crate::engine::{Engine, Gpu};

/// Time that one stage took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageTime {
    /// Name of the stage.
    pub name: &'static str,
    /// Wall seconds.
    pub seconds: f64,
    /// Processor seconds of the whole process meanwhile, in steps of 10 ms; `None` where the system
    /// does not tell.
    pub cpu_seconds: Option<f64>,
    /// Whether kernels ran on a device meanwhile; else all of it was done on the CPU.
    pub on_device: bool,
}

/// Attributes the time since the last call to stages.
#[derive(Debug)]
pub struct Stopwatch {
    wall: Instant,
    cpu: Option<f64>,
    /// The engine whose device is watched, and the dispatches it had recorded at the last call.
    engine: Option<Engine>,
    dispatched: u64,
    stages: Vec<StageTime>,
}

impl Default for Stopwatch {
    fn default() -> Self {
        Self::new()
    }
}

impl Stopwatch {
    /// Starts the clock, for work on the CPU.
    pub fn new() -> Self {
        Self { wall: Instant::now(), cpu: process_seconds(), engine: None, dispatched: 0, stages: Vec::new() }
    }

    /// Starts the clock and watches whether the device of `engine` runs kernels.
    pub fn on(engine: &Engine) -> Self {
        let dispatched = engine.gpu().map_or(0, Gpu::dispatched);
        Self { engine: Some(engine.clone()), dispatched, ..Self::new() }
    }

    /// The stages so far, in order of their first lap.
    pub fn stages(&self) -> &[StageTime] {
        &self.stages
    }

    /// Adds the time since the last call to `name`.
    pub fn lap(&mut self, name: &'static str) {
        let (wall, cpu) = (Instant::now(), process_seconds());
        let seconds = wall.duration_since(self.wall).as_secs_f64();
        let cpu_seconds = cpu.zip(self.cpu).map(|(now, then)| now - then);
        let dispatched = self.engine.as_ref().and_then(Engine::gpu).map_or(0, Gpu::dispatched);
        let on_device = dispatched != self.dispatched;
        (self.wall, self.cpu, self.dispatched) = (wall, cpu, dispatched);
        match self.stages.iter_mut().find(|s| s.name == name) {
            Some(stage) => {
                stage.seconds += seconds;
                stage.cpu_seconds = stage.cpu_seconds.zip(cpu_seconds).map(|(a, b)| a + b);
                stage.on_device |= on_device;
            }
            None => self.stages.push(StageTime { name, seconds, cpu_seconds, on_device }),
        }
    }
}

/// User and system time of this process, from Linux's process table (in ticks of 1/100 s on every
/// Linux).
fn process_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name in parentheses may hold spaces; user and system time are fields 14 and 15.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some((next()? + next()?) / 100.0)
}
