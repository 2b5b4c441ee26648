//! Starting, borrowing and losing devices.

use std::process::Command;

use barymap::Error;
use barymap::engine::reduce::RUN;
use barymap::engine::{Backend, Compaction, DeviceLimits, Engine, EngineOptions, Matching, Staging, Traffic};

use crate::{devices, downlevel, engine};

#[test]
fn an_adapter_that_is_not_there_is_an_error() {
    let options = EngineOptions { adapter: Some("no such adapter 3f9a".into()), ..EngineOptions::default() };
    for backend in [Backend::Gpu, Backend::Auto] {
        let refused = Engine::new(EngineOptions { backend, ..options.clone() }).unwrap_err();
        assert!(matches!(refused, Error::NoAdapter { .. }), "{refused}");
        assert!(refused.to_string().contains("--backend cpu"), "{refused}");
    }
}

#[test]
fn adapters_are_listed_and_found_by_part_of_their_name() {
    if engine().is_none() {
        return;
    }
    let list = Engine::adapters();
    // The best hardware adapter is what `auto` takes.
    assert_eq!(list.iter().filter(|a| a.preferred).count(), usize::from(!list[0].software));
    let part: String = list[0].name.to_uppercase().chars().take(5).collect();
    let options = EngineOptions {
        backend: Backend::Gpu,
        adapter: Some(part),
        cpu_stages: vec!["x".into()],
        ..Default::default()
    };
    let found = Engine::new(options).unwrap();
    assert_eq!(found.description().name, list[0].name);
    assert!(found.gpu_for("x").is_none() && found.gpu_for("y").is_some());
}

#[test]
fn the_loop_canary_tells_what_the_driver_does() {
    for gpu in devices() {
        let c = gpu.capabilities();
        if c.truncates_loops {
            assert!(c.loop_budget < 70_000 && c.check_loops("k", 70_000).is_err());
        } else {
            assert!(c.check_loops("k", 70_000).is_ok());
        }
        assert!(c.check_loops("k", u64::from(c.loop_budget)).is_ok());
    }
}

#[test]
fn a_downlevel_device_has_downlevel_limits() {
    let Some(gpu) = downlevel().and_then(Engine::gpu) else { return };
    let c = gpu.capabilities();
    assert_eq!((c.max_storage_buffers, c.max_uniform_binding), (4, 16 * 1024));
}

#[test]
fn a_borrowed_device_runs_kernels() {
    if engine().is_none() {
        return;
    }
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).unwrap();
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).unwrap();
    let borrowed = Engine::from_device(&adapter.get_info(), device, queue).unwrap();
    let gpu = borrowed.gpu().unwrap();
    let values = gpu.upload("values", &[1.0f32, 2.0, 3.5]).unwrap();
    assert_eq!(gpu.sum(&values, 3).unwrap(), 6.5);
}

#[test]
fn awaited_calls_do_what_waiting_ones_do() {
    if engine().is_none() {
        return;
    }
    let options = EngineOptions { backend: Backend::Gpu, ..Default::default() };
    let awaited = pollster::block_on(Engine::start(options.clone())).unwrap();
    assert_eq!(awaited.description(), Engine::new(options.clone()).unwrap().description());
    let gpu = awaited.gpu().unwrap();
    let values = gpu.upload("values", &[1u32, 2, 3]).unwrap();
    assert_eq!(pollster::block_on(gpu.read_async(&values, 1..3)).unwrap(), [2, 3]);
    assert!(pollster::block_on(gpu.read_async(&values, 2..2)).unwrap().is_empty());
    let beyond = pollster::block_on(gpu.read_async(&values, 1..4)).unwrap_err();
    assert_eq!(beyond.to_string(), gpu.read(&values, 1..4).unwrap_err().to_string());

    let auto = EngineOptions::default();
    let found = pollster::block_on(Engine::start(auto.clone())).unwrap();
    assert_eq!(found.note(), Engine::new(auto.clone()).unwrap().note());
    for wanted in [options, auto] {
        let missing = EngineOptions { adapter: Some("no such adapter 3f9a".into()), ..wanted };
        let refused = pollster::block_on(Engine::start(missing)).unwrap_err();
        assert!(matches!(refused, Error::NoAdapter { .. }), "{refused}");
    }
    let cpu = EngineOptions { backend: Backend::Cpu, ..Default::default() };
    assert!(pollster::block_on(Engine::start(cpu)).unwrap().gpu().is_none());
}

#[test]
fn traffic_is_counted() {
    if engine().is_none() {
        return;
    }
    let own = Engine::new(EngineOptions { backend: Backend::Gpu, ..Default::default() }).unwrap();
    let gpu = own.gpu().unwrap();
    let before = gpu.traffic();
    let values = gpu.upload("values", &[0.5f32; 1000]).unwrap();
    let up = gpu.traffic() - before;
    assert_eq!(up, Traffic { bytes_up: 4000, allocations: 1, ..Traffic::default() });
    gpu.table("table", &[[1u32; 4]; 3]).unwrap();
    let table = gpu.traffic() - before - up;
    // Rows of 2,048 texels of 16 bytes.
    assert_eq!(table, Traffic { bytes_up_once: 2048 * 16, allocations: 1, ..Traffic::default() });
    let before = gpu.traffic();
    gpu.read(&values, 10..110).unwrap();
    let read = gpu.traffic() - before;
    assert_eq!(read, Traffic { bytes_down: 400, submissions: 1, waits: 1, allocations: 1, ..Traffic::default() });
    let before = gpu.traffic();
    assert_eq!(gpu.sum(&values, 1000).unwrap(), 500.0);
    let sum = gpu.traffic() - before;
    assert_eq!((sum.dispatches, sum.submissions, sum.waits), (1, 2, 1));
    // One span up, one number for each run of the reduction down.
    assert_eq!((sum.bytes_up, sum.bytes_down), (16, 4 * 1000u64.div_ceil(RUN as u64)));
}

#[test]
fn a_batch_in_another_s_encoder_is_submitted_by_its_owner() {
    if engine().is_none() {
        return;
    }
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).unwrap();
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).unwrap();
    let borrowed = Engine::from_device(&adapter.get_info(), device.clone(), queue.clone()).unwrap();
    let gpu = borrowed.gpu().unwrap();
    let items = gpu.upload("items", &[3u32, 1, 3, 3, 0]).unwrap();
    let other = gpu.buffer::<u32>("other", 5).unwrap();
    let threes = Compaction::new(gpu, &items, 5, Matching { stride: 1, offset: 0, value: 3, mask: !0 }).unwrap();

    let before = gpu.traffic();
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut batch = gpu.batch_into(&mut encoder).unwrap();
    threes.record(&mut batch, 5).unwrap();
    batch.copy(&items, 1, &other, 0, 4).unwrap();
    batch.encode().unwrap();
    let recorded = gpu.traffic() - before;
    assert_eq!((recorded.submissions, recorded.waits, recorded.allocations), (0, 0, 0));
    assert_eq!(recorded.dispatches, 3);
    queue.submit([encoder.finish()]);
    assert_eq!(threes.read(gpu).unwrap(), [0, 2, 3]);
    assert_eq!(gpu.read(&other, 0..5).unwrap(), [1, 3, 3, 0, 0]);

    // Its owner submits it, nobody else.
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    assert!(gpu.batch_into(&mut encoder).unwrap().submit().is_err());
}

#[test]
fn one_wait_brings_several_buffers_back() {
    if engine().is_none() {
        return;
    }
    let own = Engine::new(EngineOptions { backend: Backend::Gpu, ..Default::default() }).unwrap();
    let gpu = own.gpu().unwrap();
    let floats = gpu.upload("floats", &[0.5f32, 1.5, 2.5, 3.5]).unwrap();
    let words = gpu.upload("words", &[7u32, 8]).unwrap();
    let mut of_floats = Staging::new(gpu, "floats", 4).unwrap();
    let mut of_words = Staging::new(gpu, "words", 2).unwrap();
    assert!(of_words.take(<[u32]>::len).is_err(), "nothing was read yet");
    for _ in 0..2 {
        let before = gpu.traffic();
        let mut batch = gpu.batch().unwrap();
        of_floats.record(&mut batch, &floats, &[3..4, 0..2]).unwrap();
        of_words.record_all(&mut batch, &words).unwrap();
        assert!(of_words.record_all(&mut batch, &words).is_err(), "the last copy was not taken");
        let submission = batch.submit().unwrap();
        gpu.wait(&submission).unwrap();
        assert!(gpu.is_done(&submission).unwrap());
        assert_eq!(of_floats.take(<[f32]>::to_vec).unwrap(), [3.5, 0.5, 1.5]);
        assert_eq!(of_words.take(<[u32]>::to_vec).unwrap(), [7, 8]);
        let read = gpu.traffic() - before;
        assert_eq!(read, Traffic { bytes_down: 12 + 8, submissions: 1, waits: 1, ..Traffic::default() });
    }
    let mut batch = gpu.batch().unwrap();
    assert!(of_words.record(&mut batch, &words, &[0..2, 0..1]).is_err(), "there is no room for three");
}

#[test]
fn a_lost_device_is_an_error_at_every_entry() {
    if engine().is_none() {
        return;
    }
    let own = Engine::new(EngineOptions { backend: Backend::Gpu, ..Default::default() }).unwrap();
    let gpu = own.gpu().unwrap();
    let values = gpu.upload("values", &[1.0f32]).unwrap();
    gpu.destroy();
    let lost = [
        gpu.check(),
        gpu.buffer::<f32>("b", 4).map(drop),
        gpu.write(&values, 0, &[2.0]),
        gpu.uniform("u", &[0.0f32; 4]).map(drop),
        gpu.batch().map(drop),
        gpu.read(&values, 0..1).map(drop),
        gpu.sum(&values, 1).map(drop),
    ];
    for (i, outcome) in lost.into_iter().enumerate() {
        assert!(matches!(outcome, Err(Error::Device { .. })), "entry {i}");
    }
}

#[test]
fn memory_and_binding_limits_are_errors() {
    if engine().is_none() {
        return;
    }
    let options = EngineOptions { backend: Backend::Gpu, memory: Some(1 << 20), ..Default::default() };
    let own = Engine::new(options).unwrap();
    let gpu = own.gpu().unwrap();
    let before = gpu.memory_held();
    let kept = gpu.buffer::<u8>("kept", 1 << 19).unwrap();
    let refused = gpu.buffer::<u8>("refused", 1 << 20).unwrap_err();
    assert!(matches!(refused, Error::Memory { .. }) && refused.to_string().contains("--memory"), "{refused}");
    drop(kept);
    assert_eq!(gpu.memory_held(), before, "dropped and refused buffers are given back");
    let most = gpu.capabilities().max_elements::<f32>() as usize;
    assert!(matches!(gpu.buffer::<f32>("large", most + 1), Err(Error::Capability { .. })));
}

#[test]
fn ranges_outside_a_buffer_are_errors() {
    for gpu in devices() {
        let b = gpu.upload("b", &[1.0f32, 2.0]).unwrap();
        assert!(gpu.read(&b, 1..3).is_err());
        assert!(gpu.write(&b, 2, &[1.0]).is_err());
        assert!(gpu.write(&b, usize::MAX, &[1.0]).is_err());
        assert!(gpu.sum(&b, 3).is_err());
        assert_eq!(gpu.read(&b, 1..2).unwrap(), [2.0]);
        assert_eq!(gpu.read(&b, 2..2).unwrap(), [0.0f32; 0]);
    }
}

/// Set in the child process of the test below.
const CHILD: &str = "BARYMAP_TEST_NO_DRIVER";

#[test]
fn without_a_driver_the_processor_works_and_says_so() {
    if std::env::var_os(CHILD).is_some() {
        assert!(Engine::adapters().is_empty());
        let refused = Engine::new(EngineOptions { backend: Backend::Gpu, ..Default::default() }).unwrap_err();
        assert!(refused.to_string().contains("mesa-vulkan-drivers"), "{refused}");
        let limits = DeviceLimits::Downlevel;
        let auto = Engine::new(EngineOptions { limits, ..Default::default() }).unwrap();
        assert_eq!(auto.backend(), Backend::Cpu);
        assert!(auto.note().is_some_and(|n| n.starts_with("working on the CPU")));
        return;
    }
    // The loader of Vulkan drivers reads its list once, so the missing driver needs a process of
    // its own.
    let name = "device::without_a_driver_the_processor_works_and_says_so";
    let status = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--quiet"])
        .env(CHILD, "1")
        .env("VK_DRIVER_FILES", "/nonexistent/driver.json")
        .env("VK_ICD_FILENAMES", "/nonexistent/driver.json")
        .env_remove("BARYMAP_REQUIRE_GPU")
        .status()
        .unwrap();
    assert!(status.success());
}
