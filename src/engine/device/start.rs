//! Starting an engine on a device.

use std::sync::Arc;

use super::adapters::{self, Wanted};
use super::canary;
use super::gpu::Gpu;
use crate::engine::{Backend, Capabilities, Description, DeviceLimits, Engine, EngineOptions};
use crate::error::{Error, Result};

/// Fails where a thread cannot wait for a device, as in a browser: waiting there would end the
/// program.
fn must_wait() -> Result<()> {
    if cfg!(not(target_arch = "wasm32")) {
        return Ok(());
    }
    Err(Error::NoAdapter {
        what: "a thread of a browser cannot wait for a device".into(),
        remedy: "Use the CPU back end".into(),
    })
}

impl Engine {
    /// An engine on a device the caller made and keeps. Its limits are what the device was created
    /// with; its callbacks for loss and stray errors stay the caller's.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails the start-up tests; [`Error::NoAdapter`] in a browser.
    pub fn from_device(info: &wgpu::AdapterInfo, device: wgpu::Device, queue: wgpu::Queue) -> Result<Self> {
        must_wait()?;
        Self::with_device(info, device, queue, &EngineOptions::default(), false)
    }

    /// On the adapter that is named, or else the best; software counts where it is wanted.
    pub(in crate::engine) fn on_adapter(options: &EngineOptions, software: bool) -> Result<Self> {
        must_wait()?;
        let wanted = if software { Wanted::Any } else { Wanted::Hardware };
        let named = options.adapter.clone().or_else(|| std::env::var("WGPU_ADAPTER_NAME").ok());
        let adapter = adapters::choose(named.as_deref().map_or(wanted, Wanted::Named))?;
        let info = adapter.get_info();
        let required_limits = match options.limits {
            DeviceLimits::Adapter => adapter.limits(),
            DeviceLimits::Downlevel => wgpu::Limits::downlevel_defaults().or_worse_values_from(&adapter.limits()),
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("barymap"),
            required_limits,
            ..Default::default()
        }))
        .map_err(|e| Error::Device {
            what: format!("adapter '{}' could not be started: {e}", info.name),
            remedy: "Choose another with --adapter (barymap devices lists them) or use --backend cpu".into(),
        })?;
        Self::with_device(&info, device, queue, options, true)
    }

    fn with_device(
        info: &wgpu::AdapterInfo,
        device: wgpu::Device,
        queue: wgpu::Queue,
        options: &EngineOptions,
        owned: bool,
    ) -> Result<Self> {
        let capabilities = Capabilities::from_limits(&device.limits(), adapters::is_software(info));
        let mut gpu = Gpu::new(device, queue, capabilities, options.memory, options.timeout);
        if owned {
            gpu.watch();
        }
        canary::run(&mut gpu)?;
        let description = Description {
            backend: Backend::Gpu.word().into(),
            name: info.name.clone(),
            driver: format!("{}, {}", adapters::driver(info), info.backend),
        };
        Ok(Self {
            backend: Backend::Gpu,
            gpu: Some(Arc::new(gpu)),
            description,
            note: None,
            cpu_stages: options.cpu_stages.clone(),
        })
    }
}
