//! Wall and processor time by stage.

use std::time::Instant;

/// Time that one stage took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageTime {
    /// Name of the stage.
    pub name: &'static str,
    /// Wall seconds.
    pub seconds: f64,
    /// Processor seconds of the whole process meanwhile, in steps of 10 ms; `None` where the system does not tell.
    pub cpu_seconds: Option<f64>,
}

/// Attributes the time since the last call to stages.
#[derive(Debug)]
pub struct Stopwatch {
    wall: Instant,
    cpu: Option<f64>,
    stages: Vec<StageTime>,
}

impl Default for Stopwatch {
    fn default() -> Self {
        Self::new()
    }
}

impl Stopwatch {
    /// Starts the clock.
    pub fn new() -> Self {
        Self { wall: Instant::now(), cpu: process_seconds(), stages: Vec::new() }
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
        (self.wall, self.cpu) = (wall, cpu);
        match self.stages.iter_mut().find(|s| s.name == name) {
            Some(stage) => {
                stage.seconds += seconds;
                stage.cpu_seconds = stage.cpu_seconds.zip(cpu_seconds).map(|(a, b)| a + b);
            }
            None => self.stages.push(StageTime { name, seconds, cpu_seconds }),
        }
    }
}

/// User and system time of this process, from Linux's process table (in ticks of 1/100 s on every Linux).
fn process_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name in parentheses may hold spaces; user and system time are fields 14 and 15.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some((next()? + next()?) / 100.0)
}
