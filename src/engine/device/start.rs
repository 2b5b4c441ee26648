//! Starting an engine on a device.

use std::sync::Arc;

use super::adapters::{self, Wanted};
use super::canary;
use super::gpu::Gpu;
use super::waiting::block_on;
use crate::engine::{Backend, Capabilities, Description, DeviceLimits, Engine, EngineOptions};
use crate::error::{Error, Result};

impl Engine {
    /// An engine on a device the caller made and keeps. Its limits are what the device was created
    /// with; its callbacks for loss and stray errors stay the caller's.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails the start-up tests; [`Error::NoAdapter`] in a browser,
    /// which has [`Engine::start_on`].
    pub fn from_device(info: &wgpu::AdapterInfo, device: wgpu::Device, queue: wgpu::Queue) -> Result<Self> {
        block_on(Self::start_on(info, device, queue))
    }

    /// [`Engine::from_device`] for a browser, where no thread can wait.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails the start-up tests.
    pub async fn start_on(info: &wgpu::AdapterInfo, device: wgpu::Device, queue: wgpu::Queue) -> Result<Self> {
        Self::with_device(info, device, queue, &EngineOptions::default(), false).await
    }

    /// On the adapter that is named, or else the best; software counts where it is wanted.
    pub(in crate::engine) fn on_adapter(options: &EngineOptions, software: bool) -> Result<Self> {
        block_on(Self::start_adapter(options, software))
    }

    /// The same, awaited.
    pub(in crate::engine) async fn start_adapter(options: &EngineOptions, software: bool) -> Result<Self> {
        let wanted = if software { Wanted::Any } else { Wanted::Hardware };
        let named = options.adapter.clone().or_else(|| std::env::var("WGPU_ADAPTER_NAME").ok());
        let adapter = adapters::choose(named.as_deref().map_or(wanted, Wanted::Named)).await?;
        let info = adapter.get_info();
        let required_limits = match options.limits {
            DeviceLimits::Adapter => adapter.limits(),
            DeviceLimits::Downlevel => wgpu::Limits::downlevel_defaults().or_worse_values_from(&adapter.limits()),
        };
        let description = wgpu::DeviceDescriptor { label: Some("barymap"), required_limits, ..Default::default() };
        let (device, queue) = adapter.request_device(&description).await.map_err(|e| Error::Device {
            what: format!("adapter '{}' could not be started: {e}", info.name),
            remedy: "Choose another with --adapter (barymap devices lists them) or use --backend cpu".into(),
        })?;
        Self::with_device(&info, device, queue, options, true).await
    }

    async fn with_device(
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
        canary::run(&mut gpu).await?;
        let description = Description {
            backend: Backend::Gpu.word().into(),
            name: adapters::name(info),
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
