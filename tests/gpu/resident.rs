//! Transfers whose texels stay on the device, against the same transfer with texels that return to
//! the host between stages.

use barymap::conformance::Scene;
use barymap::control::Control;
use barymap::engine::{Backend, Engine, EngineOptions, Gpu, Traffic};
use barymap::geometry::NONE;
use barymap::picture::{Depth, Image, Pixels};
use barymap::progress::Quiet;
use barymap::surface::PointMap;
use barymap::surface::correspondence::{CorrespondenceOptions, Method};
use barymap::surface::gpu::correspondence_on;
use barymap::tools::transfer::{
    Background, Encoding, Fill, Filter, Layer, LayerKind, TransferOptions, TransferOutput, transfer_on,
};

use crate::common::flat::{Random, noise};
use crate::transfer_sample::{picture, same_transfer};
use crate::{downlevel, engine};

/// A device that the stages `cpu_stages` do not use.
fn without(cpu_stages: &[&str]) -> Engine {
    let cpu_stages = cpu_stages.iter().map(|s| (*s).into()).collect();
    Engine::new(EngineOptions { backend: Backend::Gpu, cpu_stages, ..EngineOptions::default() }).unwrap()
}

/// Two balls, pictures for the source, and what the host keeps of a map.
struct Job {
    scene: Scene,
    images: Vec<Image>,
}

impl Job {
    fn new() -> Self {
        let mut r = Random(6);
        let labels = (0..40 * 30).map(|i| (i % 7) as u8).collect();
        let images = vec![
            noise(64, 48, 4, 3),
            noise(300, 200, 3, 4),
            picture(50, 20, 1, Depth::U16, &mut r),
            picture(16, 16, 3, Depth::F32, &mut r),
            picture(33, 31, 2, Depth::U8, &mut r),
            Image::new(40, 30, 1, Pixels::U8(labels)).unwrap(),
        ];
        Self { scene: Scene::textured(60), images }
    }

    fn map(&self, engine: &Engine, method: Method) -> Box<dyn PointMap + Send> {
        let (source, target) = self.scene.shapes();
        let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
        correspondence_on(engine, source, target, &self.scene.anchors, &options).unwrap().0
    }

    /// Colours alone, of all depths: one picture, and two of which one shows on every third
    /// triangle and the other on none of every fifth.
    fn colours(&self) -> Vec<Layer<'_>> {
        let pictures = |k: &[usize]| -> Vec<&Image> { k.iter().map(|&i| &self.images[i]).collect() };
        let of = |t: u32| if t % 5 == 4 { NONE } else { u32::from(t.is_multiple_of(3)) };
        let two = |k: &[usize], light: bool| Layer {
            images: pictures(k),
            face_texture: Some((0..self.scene.source.0.triangle_count() as u32).map(of).collect()),
            encoding: Encoding { linear_light: light, ..Encoding::default() },
            ..Layer::single("two", &self.images[0])
        };
        vec![
            Layer::single("colour", &self.images[0]),
            two(&[1, 4], true),
            two(&[2, 2], false),
            Layer::single("light", &self.images[3]),
        ]
    }

    /// Colours, and what the host makes.
    fn mixed(&self) -> Vec<Layer<'_>> {
        let kind = |image: usize, kind: LayerKind| Layer { kind, ..Layer::single("other", &self.images[image]) };
        vec![
            Layer::single("colour", &self.images[1]),
            kind(5, LayerKind::Labels),
            kind(1, LayerKind::tangent_normal()),
            Layer::single("grey", &self.images[2]),
        ]
    }

    fn run(&self, engine: &Engine, layers: &[Layer<'_>], map: &dyn PointMap, options: &TransferOptions) -> Ran {
        let (source, target) = (&self.scene.source.0, &self.scene.target.0);
        let before = engine.gpu().map(Gpu::traffic).unwrap_or_default();
        let out = transfer_on(engine, source, layers, target, map, options, &Quiet).unwrap();
        Ran { traffic: engine.gpu().map(Gpu::traffic).unwrap_or_default() - before, out }
    }

    /// The same, where the device may have too little memory for the map itself.
    fn fits(&self, engine: &Engine, layers: &[Layer<'_>], map: &dyn PointMap, options: &TransferOptions) -> bool {
        let (source, target) = (&self.scene.source.0, &self.scene.target.0);
        match transfer_on(engine, source, layers, target, map, options, &Quiet) {
            Ok(_) => true,
            Err(barymap::Error::Memory { .. }) => false,
            Err(error) => panic!("{error}"),
        }
    }
}

struct Ran {
    out: TransferOutput,
    traffic: Traffic,
}

impl Ran {
    fn stays(&self) -> bool {
        self.out.stats.device_stages.contains(&"store_texel")
    }
}

fn options(width: u32, height: u32) -> TransferOptions {
    TransferOptions { width, height, margin: 5, ..TransferOptions::default() }
}

#[test]
fn texels_that_stay_become_what_texels_that_return_do() {
    let job = Job::new();
    for engine in [engine(), downlevel()].into_iter().flatten() {
        let map = job.map(engine, Method::Field);
        for (k, (width, height)) in [(256, 130), (1, 1), (63, 65), (700, 600), (129, 8)].into_iter().enumerate() {
            let background = if k % 2 == 0 { Background::Transparent } else { Background::Color([0.2, 0.4, 0.6, 1.0]) };
            let filter =
                [Filter::Anisotropic, Filter::Trilinear, Filter::Ewa, Filter::Lanczos, Filter::Bilinear][k % 5];
            let options = TransferOptions { background, filter, ..options(width, height) };
            let found = job.run(engine, &job.colours(), map.as_ref(), &options);
            assert!(found.stays() && found.out.stats.notes.is_empty(), "{:?}", found.out.stats);
            // The same map, on the device, by one stage after the other.
            let host = without(&["locate"]);
            let expected = job.run(&host, &job.colours(), job.map(&host, Method::Field).as_ref(), &options);
            assert!(!expected.stays());
            same_transfer(&expected.out, &found.out).unwrap_or_else(|e| panic!("{width} x {height}: {e}"));
        }
    }
}

#[test]
fn what_the_host_makes_and_fills_is_the_same_beside_texels_that_stay() {
    let Some(engine) = engine() else { return };
    let job = Job::new();
    let host = without(&["footprint"]);
    let (map, on_host) = (job.map(engine, Method::Field), job.map(&host, Method::Field));
    for (fill, coordinates) in [(Fill::None, false), (Fill::None, true), (Fill::Smooth, true)] {
        let options = TransferOptions { fill, fill_doubtful: true, coordinates, ..options(200, 150) };
        for layers in [job.mixed(), job.colours()] {
            let found = job.run(engine, &layers, map.as_ref(), &options);
            let expected = job.run(&host, &layers, on_host.as_ref(), &options);
            assert!(found.stays() && !expected.stays());
            same_transfer(&expected.out, &found.out).unwrap_or_else(|e| panic!("{fill:?}: {e}"));
            assert_eq!(expected.out.stats.filled, found.out.stats.filled);
            assert_eq!(expected.out.coordinates.is_some(), found.out.coordinates.is_some());
            if let (Some(a), Some(b)) = (&expected.out.coordinates, &found.out.coordinates) {
                let apart = (0..a.pixels.len()).map(|i| (a.sample(i) - b.sample(i)).abs()).fold(0.0, f32::max);
                assert!(apart <= 1e-5, "{apart}");
            }
        }
    }
}

#[test]
fn averages_stay_on_the_device_too() {
    let Some(engine) = engine() else { return };
    let job = Job::new();
    let host = without(&["store_texel"]);
    for method in [Method::Averages, Method::Transport] {
        let layers = [Layer::single("colour", &job.images[1])];
        let options = options(150, 120);
        let found = job.run(engine, &layers, job.map(engine, method).as_ref(), &options);
        let expected = job.run(&host, &layers, job.map(&host, method).as_ref(), &options);
        assert!(found.stays() && !expected.stays());
        same_transfer(&expected.out, &found.out).unwrap_or_else(|e| panic!("{method:?}: {e}"));
    }
}

#[test]
fn bands_and_repetition_do_not_show() {
    let Some(engine) = engine() else { return };
    let job = Job::new();
    let map = job.map(engine, Method::Field);
    for layers in [job.colours(), job.mixed()] {
        let options = options(300, 222);
        let all = job.run(engine, &layers, map.as_ref(), &options).out;
        let again = job.run(engine, &layers, map.as_ref(), &options).out;
        assert_eq!((&all.layers, &all.coverage), (&again.layers, &again.coverage));
        let mut memory = all.stats.memory;
        let banded = loop {
            memory -= 2 << 20;
            let ran = job.run(engine, &layers, map.as_ref(), &TransferOptions { memory, ..options.clone() });
            assert!(ran.stays(), "{:?}", ran.out.stats.notes);
            if ran.out.stats.bands > 2 {
                break ran.out;
            }
        };
        assert_eq!((&all.layers, &all.coverage), (&banded.layers, &banded.coverage));
        assert_eq!(all.stats.valid_fraction.to_bits(), banded.stats.valid_fraction.to_bits());
    }
}

#[test]
fn what_crosses_the_bus_is_the_result_and_little_more() {
    if engine().is_none() {
        return;
    }
    // Its own, so that nothing else is counted.
    let engine = without(&[]);
    let job = Job::new();
    let map = job.map(&engine, Method::Field);
    let (width, height) = (1024, 512);
    let texels = u64::from(width * height);
    let options = options(width, height);
    let layers = |n: usize| vec![Layer::single("colour", &job.images[0]); n];
    let count = |n: usize| {
        let ran = job.run(&engine, &layers(n), map.as_ref(), &options);
        assert!(ran.stays());
        let bands = ran.out.stats.bands;
        // Four bytes a texel of a picture, one of coverage; 32 for each run of 1,024; of a band the
        // head of the list of points left and 512 records.
        let down = texels * (4 * n as u64 + 1) + texels / 1024 * 32 + bands * 513 * 16;
        assert_eq!(ran.traffic.bytes_down, down, "{n} layers, {bands} bands");
        assert_eq!(ran.traffic.waits, bands + 1, "one a band, and one for the result");
        ran.traffic
    };
    let (one, two) = (count(1), count(2));
    let crossed = |t: &Traffic| (t.bytes_up + t.bytes_down) as f64 / texels as f64;
    assert!(crossed(&one) <= 6.0, "{} bytes a texel", crossed(&one));
    assert!(crossed(&two) - crossed(&one) <= 4.01, "{}", crossed(&two) - crossed(&one));
    println!("{} bytes a texel, {} with two layers, {} waits", crossed(&one), crossed(&two), one.waits);
}

#[test]
fn a_device_with_little_memory_lets_texels_return_and_says_so() {
    if engine().is_none() {
        return;
    }
    let job = Job::new();
    let layers = [Layer::single("colour", &job.images[0])];
    let expected = {
        let engine = without(&[]);
        job.run(&engine, &layers, job.map(&engine, Method::Field).as_ref(), &options(200, 140)).out
    };
    let mut stayed = Vec::new();
    for megabytes in (24..80).step_by(4).chain([1024]) {
        let memory = Some(megabytes << 20);
        let own = EngineOptions { backend: Backend::Gpu, memory, ..EngineOptions::default() };
        let engine = Engine::new(own).unwrap();
        let map = job.map(&engine, Method::Field);
        let held = engine.gpu().map(Gpu::memory_held);
        if !job.fits(&engine, &layers, map.as_ref(), &options(200, 140)) {
            // A device that is a little too small for what was begun ends in a clear error.
            continue;
        }
        let ran = job.run(&engine, &layers, map.as_ref(), &options(200, 140));
        let told = ran.out.stats.notes.iter().any(|n| n.contains("return to the host"));
        assert_eq!(ran.stays(), !told, "{:?}", ran.out.stats.notes);
        stayed.push(ran.stays());
        same_transfer(&expected, &ran.out).unwrap();
        assert_eq!(engine.gpu().map(Gpu::memory_held), held, "everything is given back");
    }
    println!("{stayed:?}");
    assert!(stayed.is_sorted() && stayed.last() == Some(&true), "{stayed:?}");
}

#[test]
fn a_device_lost_in_the_middle_is_an_error() {
    if engine().is_none() {
        return;
    }
    /// Progress that destroys the device when the first band is done.
    struct Fatal<'a>(&'a Engine);
    impl barymap::progress::Progress for Fatal<'_> {
        fn stage(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {
            self.0.gpu().unwrap().destroy();
        }
    }
    let engine = without(&[]);
    let job = Job::new();
    let map = job.map(&engine, Method::Field);
    let layers = [Layer::single("colour", &job.images[0])];
    let (source, target) = (&job.scene.source.0, &job.scene.target.0);
    let lost = transfer_on(&engine, source, &layers, target, map.as_ref(), &options(256, 256), &Fatal(&engine));
    assert!(matches!(lost, Err(barymap::Error::Device { .. })), "{lost:?}");
}

#[test]
fn a_cancelled_transfer_gives_the_device_back() {
    if engine().is_none() {
        return;
    }
    let engine = without(&[]);
    let job = Job::new();
    let map = job.map(&engine, Method::Field);
    let layers = [Layer::single("colour", &job.images[0])];
    let (source, target) = (&job.scene.source.0, &job.scene.target.0);
    let work = || transfer_on(&engine, source, &layers, target, map.as_ref(), &options(256, 256), &Quiet);
    let whole = Control::new();
    let expected = whole.run(work).unwrap();
    // At its begin and in the only band. Waits look now and then, too; how often depends on time.
    let ends = [1, 2];
    assert!(whole.checks() >= ends[1], "{} looks", whole.checks());
    let held = engine.gpu().map(Gpu::memory_held);
    for end in ends {
        let control = Control::new();
        control.cancel_at(end);
        let cancelled = control.run(work);
        assert!(matches!(cancelled, Err(barymap::Error::Cancelled)), "goes on at look {end}");
        assert_eq!(engine.gpu().map(Gpu::memory_held), held, "everything is given back");
    }
    same_transfer(&expected, &work().unwrap()).unwrap();
}
