//! Wall and processor time by stage, where it ran, and what crossed to a device and back.

use web_time::Instant;

use crate::engine::{Engine, Gpu, Traffic};

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
    /// What crossed to the device and back meanwhile.
    pub traffic: Traffic,
}

impl StageTime {
    /// Whether kernels ran on a device in this stage; else all of it was done on the CPU.
    pub fn on_device(&self) -> bool {
        self.traffic.dispatches > 0
    }

    /// Adds what the same stage took another time.
    pub fn add(&mut self, more: &Self) {
        self.seconds += more.seconds;
        self.cpu_seconds = self.cpu_seconds.zip(more.cpu_seconds).map(|(a, b)| a + b);
        self.traffic += more.traffic;
    }
}

/// Attributes the time since the last call to stages.
#[derive(Debug)]
pub struct Stopwatch {
    wall: Instant,
    cpu: Option<f64>,
    /// The engine whose device is watched, and its counters at the last call.
    engine: Option<Engine>,
    traffic: Traffic,
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
        Self {
            wall: Instant::now(),
            cpu: process_seconds(),
            engine: None,
            traffic: Traffic::default(),
            stages: Vec::new(),
        }
    }

    /// Starts the clock and watches the device of `engine`.
    pub fn on(engine: &Engine) -> Self {
        let traffic = engine.gpu().map(Gpu::traffic).unwrap_or_default();
        Self { engine: Some(engine.clone()), traffic, ..Self::new() }
    }

    /// The stages so far, in order of their first lap.
    pub fn stages(&self) -> &[StageTime] {
        &self.stages
    }

    /// Adds the time since the last call to `name`.
    pub fn lap(&mut self, name: &'static str) {
        let (wall, cpu) = (Instant::now(), process_seconds());
        let traffic = self.engine.as_ref().and_then(Engine::gpu).map(Gpu::traffic).unwrap_or_default();
        let stage = StageTime {
            name,
            seconds: wall.duration_since(self.wall).as_secs_f64(),
            cpu_seconds: cpu.zip(self.cpu).map(|(now, then)| now - then),
            traffic: traffic - self.traffic,
        };
        (self.wall, self.cpu, self.traffic) = (wall, cpu, traffic);
        match self.stages.iter_mut().find(|s| s.name == name) {
            Some(before) => before.add(&stage),
            None => self.stages.push(stage),
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
