//! The stages of a command and their shares of its time, for one measure of progress over the whole
//! job.

/// Stages in the order in which they come, and what each takes in comparison with the others. The
/// weights are for meshes of some thousand vertices and pictures of 1024 texels a side; where they
/// are wrong the bar is quicker here and slower there, and never goes back.
pub(crate) type Stages = &'static [Part];

/// Stages that come together.
type Part = &'static [(&'static str, f64)];

/// One embedding.
const EMBEDDING: Part = &[
    ("simplification", 2.0),
    ("landmarks", 1.0),
    ("geodesic distances", 8.0),
    ("multidimensional scaling", 8.0),
    ("least-squares mesh", 3.0),
];
const ALIGNMENT: Part = &[("alignment", 6.0)];

const EMBED: Stages = &[EMBEDDING];
/// Embeddings of two meshes, a map between them and pictures through it.
const TRANSFER: Stages = &[EMBEDDING, EMBEDDING, ALIGNMENT, &[("texels", 30.0), ("padding", 2.0)]];
/// The same without pictures.
const MAP: Stages = &[EMBEDDING, EMBEDDING, ALIGNMENT];
const ANCHORS: Stages = &[EMBEDDING, EMBEDDING, &[("proposing anchors", 40.0)]];
const WARP: Stages = &[&[("partition", 2.0), ("certificate", 20.0), ("pixels", 5.0)]];
const POINTS: Stages = &[&[("partition", 2.0), ("certificate", 20.0), ("points", 5.0)]];

/// The stages of a command; none where it has one alone, or none that takes long.
pub(crate) fn stages(command: &str) -> Stages {
    match command {
        "embed" | "check" | "average" | "weights" | "decal" | "spline" | "remesh" => EMBED,
        "transfer" | "batch" | "demo" => TRANSFER,
        "map" | "attributes" | "morph" => MAP,
        "anchors" => ANCHORS,
        "warp" => WARP,
        "warp-points" | "cage" => POINTS,
        _ => &[],
    }
}

/// How far a job is.
#[derive(Clone, Debug, Default)]
pub(crate) struct Plan {
    stages: Vec<(&'static str, f64)>,
    /// The stage that runs, and its own name where it is not among the stages.
    at: Option<usize>,
    /// Weight of the stages that came and are over.
    done: f64,
    /// How much of the stage is done, and of how many.
    part: (u64, u64),
    /// The item that is worked at, of how many.
    item: (usize, usize),
    /// The most that was told.
    told: f64,
}

impl Plan {
    /// Of a command that has not begun.
    pub(crate) fn new(stages: Stages) -> Self {
        Self { stages: stages.concat(), item: (0, 1), ..Self::default() }
    }

    /// Item `k` of `count` equal ones begins, with all stages before it again.
    pub(crate) fn item(&mut self, k: usize, count: usize) {
        (self.at, self.done, self.part, self.item) = (None, 0.0, (0, 0), (k, count.max(1)));
    }

    /// A stage begins. Stages that did not come, as where an embedding is in the cache, count for
    /// nothing.
    pub(crate) fn stage(&mut self, name: &str, total: u64) {
        let from = self.at.map_or(0, |k| k + 1);
        let found = (from..self.stages.len()).find(|&k| name.starts_with(self.stages[k].0));
        if let Some(k) = found {
            self.done += self.at.map_or(0.0, |k| self.stages[k].1);
            self.at = Some(k);
        }
        // A stage that comes again, or that nobody foresaw, tells only where it is the whole job.
        let whole = self.stages.is_empty();
        self.part = if found.is_some() || whole { (0, total) } else { (0, 0) };
    }

    /// More of the stage is done.
    pub(crate) fn advance(&mut self, count: u64) {
        self.part.0 = self.part.0.saturating_add(count);
    }

    /// The share of the job that is done, 0..=1; none where nothing is known of it. It does not go
    /// back.
    pub(crate) fn share(&mut self) -> Option<f64> {
        let within = match self.part {
            (_, 0) => 0.0,
            (done, total) => done.min(total) as f64 / total as f64,
        };
        let known = self.part.1 > 0 || self.at.is_some() || self.item.1 > 1;
        let now = self.at.map_or(0.0, |k| self.stages[k].1);
        let later: f64 = self.at.map_or(0.0, |k| self.stages[k + 1..].iter().map(|s| s.1).sum());
        let here = match self.at {
            Some(_) => (self.done + now * within) / (self.done + now + later),
            None => within,
        };
        let (k, count) = self.item;
        self.told = self.told.max((k as f64 + here) / count as f64);
        known.then_some(self.told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn percent(plan: &mut Plan) -> u32 {
        (100.0 * plan.share().unwrap()) as u32
    }

    #[test]
    fn the_share_is_of_the_whole_job_and_never_goes_back() {
        let mut plan = Plan::new(WARP);
        assert_eq!(plan.share(), None, "nothing has begun");
        plan.stage("partition along the linear path", 0);
        assert_eq!(percent(&mut plan), 0);
        plan.stage("certificate", 1000);
        assert_eq!(percent(&mut plan), 7, "2 of 27");
        plan.advance(500);
        assert_eq!(percent(&mut plan), 44, "12 of 27");
        plan.stage("certificate", 1000);
        assert_eq!(percent(&mut plan), 44, "what comes again does not begin anew");
        plan.stage("pixels", 10);
        plan.advance(20);
        assert_eq!(percent(&mut plan), 100);
    }

    #[test]
    fn stages_that_do_not_come_count_for_nothing() {
        // Both embeddings are in the cache.
        let mut plan = Plan::new(TRANSFER);
        plan.stage("texels", 100);
        plan.advance(50);
        assert_eq!(percent(&mut plan), 46, "15 of 32");
        plan.stage("padding", 4);
        plan.advance(2);
        assert_eq!(percent(&mut plan), 96, "31 of 32");
    }

    #[test]
    fn items_are_equal_parts() {
        let mut plan = Plan::new(WARP);
        plan.item(1, 4);
        assert_eq!(percent(&mut plan), 25);
        plan.stage("pixels", 2);
        plan.advance(1);
        assert_eq!(percent(&mut plan), 37);
        plan.item(2, 4);
        assert_eq!(percent(&mut plan), 50);
    }

    #[test]
    fn a_job_of_one_stage_needs_no_plan() {
        let mut plan = Plan::new(stages("render"));
        plan.stage("frames", 8);
        assert_eq!(percent(&mut plan), 0);
        plan.advance(6);
        assert_eq!(percent(&mut plan), 75);
        plan.stage("more", 0);
        assert_eq!(plan.share(), None);
    }
}
