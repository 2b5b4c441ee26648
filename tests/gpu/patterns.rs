//! Reductions, compaction, ping-pong, readback and slices, at awkward sizes.

use barymap::engine::reduce::{self, RUN};
use barymap::engine::{BindingKind, Compaction, Gpu, Kernel, Matching, PingPong, ReadbackRing, reflect};

use crate::devices;

/// Sizes around workgroups, runs and rows of groups.
const SIZES: &[usize] = &[0, 1, 63, 64, 65, RUN - 1, RUN, RUN + 1, 3 * RUN + 17, 70_000, 1_048_577];

/// A fixed stream of numbers with both signs and some repeats.
fn numbers(n: usize) -> Vec<f32> {
    let mut state = 0x9e37_79b9u32;
    (0..n)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 16) as f32 - 32_768.0) / 1024.0
        })
        .collect()
}

#[test]
fn the_sum_has_the_bits_of_the_fixed_tree() {
    for gpu in devices() {
        for &n in SIZES {
            let values = numbers(n);
            let on_device = gpu.sum(&gpu.upload("values", &values).unwrap(), n).unwrap();
            assert_eq!(on_device.to_bits(), reduce::sum(&values).to_bits(), "{n} values");
            let exact: f64 = values.iter().map(|v| f64::from(*v)).sum();
            assert!((f64::from(on_device) - exact).abs() <= 1e-4 * (1.0 + n as f64).sqrt(), "{n} values");
        }
    }
}

#[test]
fn the_minimum_is_the_first_of_the_smallest() {
    for gpu in devices() {
        for &n in SIZES {
            let values = numbers(n);
            let on_device = gpu.min(&gpu.upload("values", &values).unwrap(), n).unwrap();
            assert_eq!(on_device, reduce::min(&values), "{n} values");
            let plain = values.iter().copied().enumerate().reduce(|a, b| if b.1 < a.1 { b } else { a });
            assert_eq!(on_device.map(|c| (c.index as usize, c.value)), plain, "{n} values");
        }
    }
}

fn compacted(gpu: &Gpu, items: &[[u32; 3]], n: usize) -> Vec<u32> {
    let buffer = gpu.upload("items", items).unwrap();
    let matching = Matching { stride: 3, offset: 1, value: 7, mask: 7 };
    let compaction = Compaction::new(gpu, &buffer, items.len(), matching).unwrap();
    // Twice, so that what the first run left behind shows.
    for _ in 0..2 {
        let mut batch = gpu.batch().unwrap();
        compaction.record(&mut batch, n).unwrap();
        batch.submit().unwrap();
    }
    compaction.read(gpu).unwrap()
}

#[test]
fn compaction_keeps_the_order() {
    for gpu in devices() {
        for &n in SIZES {
            let items: Vec<[u32; 3]> =
                numbers(n).iter().zip(0..).map(|(v, i)| [7, if *v > 20.0 { 7 + 8 * i } else { i % 5 }, 7]).collect();
            let plain: Vec<u32> = (0..n as u32).filter(|i| items[*i as usize][1] % 8 == 7).collect();
            assert_eq!(compacted(gpu, &items, n), plain, "{n} items");
        }
        let all = vec![[0, 7, 0]; 2 * RUN + 1];
        assert_eq!(compacted(gpu, &all, all.len()).len(), all.len());
        assert_eq!(compacted(gpu, &all, RUN + 1), (0..=RUN as u32).collect::<Vec<_>>());
        assert!(
            Compaction::new(
                gpu,
                &gpu.upload("x", &[0u32; 3]).unwrap(),
                1,
                Matching { stride: 3, offset: 1, value: 7, mask: 7 }
            )
            .unwrap()
            .record(&mut gpu.batch().unwrap(), 2)
            .is_err()
        );
    }
}

#[test]
fn the_readback_ring_keeps_the_order_of_tiles() {
    for gpu in devices() {
        let tiles: Vec<Vec<f32>> = (0..7).map(|k| numbers(100 + k)).collect();
        let device = gpu.buffer::<f32>("tile", 128).unwrap();
        let mut ring = ReadbackRing::new(gpu, "tiles", 3, 128).unwrap();
        let mut back = Vec::new();
        for tile in &tiles {
            if ring.is_full() {
                back.push(ring.pop().unwrap().unwrap());
            }
            gpu.write(&device, 0, tile).unwrap();
            ring.push(gpu.batch().unwrap(), &device, 0..tile.len()).unwrap();
        }
        while let Some(tile) = ring.pop().unwrap() {
            back.push(tile);
        }
        assert_eq!(back, tiles);
        ring.push(gpu.batch().unwrap(), &device, 0..0).unwrap();
        assert_eq!(ring.pop().unwrap(), Some(vec![]));
        assert!(ring.push(gpu.batch().unwrap(), &device, 0..129).is_err());
    }
}

#[test]
fn uniform_blocks_are_cut_at_16_kib() {
    for gpu in devices() {
        for n in [0usize, 1, 1023, 1024, 1025, 5000] {
            let blocks = gpu.uniform_blocks("anchors", &vec![[1.0f32; 4]; n]).unwrap();
            assert_eq!(blocks.blocks(), n.div_ceil(1024).max(1));
            let total: usize = (0..blocks.blocks()).map(|i| blocks.block_len(i)).sum();
            assert_eq!(total, n);
        }
    }
}

/// A step of the integers, to see that every item is worked on once in every step.
static STEP: Kernel = Kernel {
    name: "test_step",
    source: "//#import lib/span
@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<storage, read> before: array<u32>;
@group(0) @binding(2) var<storage, read_write> after: array<u32>;
@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = span.first + invocation(span, id);
    if i < span.end { after[i] = before[i] * 3u + i; }
}
",
    bindings: &[BindingKind::Read, BindingKind::Write],
    layouts: &[],
    items: 1,
    constants: &[],
};

#[test]
fn steps_ping_pong_in_one_submission() {
    assert_eq!(reflect::faults(&STEP), Vec::<String>::new());
    for gpu in devices() {
        let step = gpu.pipeline(&STEP).unwrap();
        for n in [1usize, 63, 64, 65, 5000] {
            let mut pair =
                PingPong::<u32>::new(gpu, &step, "steps", n, |from, to| vec![from.bind(), to.bind()]).unwrap();
            let mut batch = gpu.batch().unwrap();
            for _ in 0..201 {
                batch.dispatch(&step, pair.step(), n).unwrap();
            }
            batch.submit().unwrap();
            let expected: Vec<u32> =
                (0..n as u32).map(|i| (0..201).fold(0u32, |x, _| x.wrapping_mul(3).wrapping_add(i))).collect();
            assert_eq!(gpu.read(pair.newest(), 0..n).unwrap(), expected, "{n} items");
        }
    }
}

#[test]
fn slices_and_rows_of_groups_cover_every_item_once() {
    for gpu in devices() {
        let step = gpu.pipeline(&STEP).unwrap();
        // More than 65,535 workgroups of 64, so that the dispatch has two rows.
        let n = 65_536 * 64 + 77;
        let before = gpu.upload("before", &vec![5u32; n]).unwrap();
        let after = gpu.buffer::<u32>("after", n).unwrap();
        let group = gpu.bind(&step, &[before.bind(), after.bind()]).unwrap();
        let mut heard = 0;
        gpu.run(&step, &group, n, |done| heard += done).unwrap();
        assert_eq!(heard, n as u64);
        let sliced = gpu.read(&after, 0..n).unwrap();
        assert!(sliced.iter().zip(0..).all(|(x, i)| *x == 15 + i));
        let mut batch = gpu.batch().unwrap();
        batch.clear(&after);
        batch.dispatch(&step, &group, n).unwrap();
        batch.submit().unwrap();
        assert_eq!(gpu.read(&after, 0..n).unwrap(), sliced);
        gpu.run(&step, &group, 0, |_| unreachable!("there are no items")).unwrap();
    }
}

#[test]
fn bindings_that_do_not_fit_the_kernel_are_errors() {
    for gpu in devices() {
        let step = gpu.pipeline(&STEP).unwrap();
        let b = gpu.buffer::<u32>("b", 4).unwrap();
        assert!(gpu.bind(&step, &[b.bind()]).is_err());
        assert!(gpu.bind(&step, &[b.bind(), gpu.uniform("u", &[0u32; 4]).unwrap().bind(0)]).is_err());
        // One buffer both read and written is refused when the batch is handed over.
        let group = gpu.bind(&step, &[b.bind(), b.bind()]).unwrap();
        let mut batch = gpu.batch().unwrap();
        batch.dispatch(&step, &group, 4).unwrap();
        assert!(batch.submit().is_err());
    }
}

static BROKEN: Kernel =
    Kernel { name: "test_broken", source: "fn main( {", bindings: &[], layouts: &[], items: 1, constants: &[] };

#[test]
fn a_kernel_the_device_refuses_is_an_error() {
    for gpu in devices() {
        let refused = gpu.pipeline(&BROKEN).unwrap_err().to_string();
        assert!(refused.contains("test_broken"), "{refused}");
        gpu.check().unwrap();
    }
}
