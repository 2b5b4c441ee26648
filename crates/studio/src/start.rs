//! The window's start.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use eframe::egui_wgpu::{WgpuSetup, WgpuSetupCreateNew};

use crate::view::{Setup, Studio};

const HELP: &str = "\
barymap-studio: the texture of one mesh on another, by pairs of points that you click.

    barymap-studio [SOURCE [TARGET]] [PICTURE] [PAIRS.json]
    barymap-studio PROJECT.json

A first mesh is the one with the texture, a second one the one that gets it. Files can be dropped
onto the window as well.";

/// The device of the window: as the engine of the library wants it.
pub fn wgpu_setup() -> WgpuSetup {
    let mut new = WgpuSetupCreateNew::without_display_handle();
    new.instance_descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    new.device_descriptor =
        Arc::new(|adapter| wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() });
    WgpuSetup::CreateNew(new)
}

/// Opens the window on these files, and returns when it is closed.
pub fn run(arguments: &[OsString]) -> ExitCode {
    if arguments.iter().any(|a| a == "--help" || a == "-h") {
        println!("{HELP}");
        return ExitCode::SUCCESS;
    }
    if let Some(option) = arguments.iter().find(|a| a.to_string_lossy().starts_with('-')) {
        eprintln!("barymap-studio: there is no option {}\n\n{HELP}", option.to_string_lossy());
        return ExitCode::from(2);
    }
    let files: Vec<PathBuf> = arguments.iter().map(PathBuf::from).collect();
    let mut options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("barymap studio")
            .with_app_id("barymap-studio")
            .with_inner_size([1280.0, 800.0])
            .with_min_inner_size([640.0, 400.0])
            .with_drag_and_drop(true),
        ..Default::default()
    };
    options.wgpu_options.wgpu_setup = wgpu_setup();
    let setup = Setup { files, ..Setup::default() };
    let result =
        eframe::run_native("barymap-studio", options, Box::new(move |cc| Ok(Box::new(Studio::new(cc, setup)?))));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!(
                "barymap-studio: no window: {error}\n\
                 It needs a display and a Vulkan, Metal or Direct3D 12 driver; on Linux without a GPU: \
                 apt-get install mesa-vulkan-drivers"
            );
            ExitCode::FAILURE
        }
    }
}
