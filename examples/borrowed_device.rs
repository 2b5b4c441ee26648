//! barymap on a device that your program made and keeps, as a window or a game does: the images of
//! points under a composite map of the plane, by kernels.
//!
//! `cargo run --release --example borrowed_device`

use std::error::Error;

use barymap::engine::Engine;
use barymap::mapping::plane::{Coordinates, Frame, Step, map_points};
use barymap::models::polygons::square_corner;
use barymap::wgpu;

fn main() -> Result<(), Box<dyn Error>> {
    let instance = wgpu::Instance::default();
    let wanted = wgpu::RequestAdapterOptions::default();
    let Ok(adapter) = pollster::block_on(instance.request_adapter(&wanted)) else {
        println!("no adapter: install a driver (barymap devices says which)");
        return Ok(());
    };
    let asked = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&asked))?;

    // Both are handles: the program keeps using its own.
    let engine = Engine::from_device(&adapter.get_info(), device.clone(), queue.clone())?;
    println!("runs on {}", engine.description());

    // One corner of a square moves towards the opposite one.
    let pair = square_corner(0.3);
    let scale = Frame::common_scale([&pair.source, &pair.target]);
    let step = Step::<f32>::new(Coordinates::MeanValue, &pair.source, &pair.target, scale);
    let mut points: Vec<[f32; 2]> =
        (0..10_000).map(|i| [(i % 100) as f32 / 400.0 - 0.12, (i / 100) as f32 / 400.0 - 0.12]).collect();
    let start = points.clone();
    map_points(&engine, &[step], &mut points)?;
    let furthest = points.iter().zip(&start).map(|(q, p)| (q[0] - p[0]).hypot(q[1] - p[1])).fold(0.0, f32::max);
    println!("{} points, moved by at most {furthest:.3} of the square's frame", points.len());
    assert!(furthest > 0.01);

    // The device is still the program's.
    drop(engine);
    device.poll(wgpu::PollType::wait_indefinitely())?;
    Ok(())
}
