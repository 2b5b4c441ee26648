//! Finding adapters and saying what they are.

use std::fmt;

use crate::error::{Error, Result};

/// One adapter of this machine, as `barymap devices` lists it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterSummary {
    /// Name as the driver gives it.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// Interface it is reached through (vulkan, metal, dx12).
    pub interface: String,
    /// Discrete, integrated, virtual or software.
    pub kind: &'static str,
    /// Whether kernels run on the CPU behind the interface (Mesa lavapipe for one).
    pub software: bool,
    /// Largest storage binding in bytes.
    pub max_storage_binding: u64,
    /// Largest buffer in bytes.
    pub max_buffer: u64,
    /// Whether [`Backend::Auto`](super::Backend::Auto) takes this one.
    pub preferred: bool,
}

impl fmt::Display for AdapterSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ({}, {}, {}), buffers up to {} MiB, bindings up to {} MiB{}",
            self.name,
            self.kind,
            self.interface,
            self.driver,
            self.max_buffer >> 20,
            self.max_storage_binding >> 20,
            if self.preferred { "; taken by --backend auto" } else { "" }
        )
    }
}

impl AdapterSummary {
    fn of(info: &wgpu::AdapterInfo, limits: &wgpu::Limits, preferred: bool) -> Self {
        Self {
            name: info.name.clone(),
            driver: driver(info),
            interface: info.backend.to_string(),
            kind: kind(info.device_type),
            software: info.device_type == wgpu::DeviceType::Cpu,
            max_storage_binding: limits.max_storage_buffer_binding_size,
            max_buffer: limits.max_buffer_size,
            preferred,
        }
    }
}

/// Driver and version in a few words.
pub(super) fn driver(info: &wgpu::AdapterInfo) -> String {
    [info.driver.as_str(), info.driver_info.as_str()]
        .into_iter()
        .filter(|s| !s.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

fn kind(t: wgpu::DeviceType) -> &'static str {
    match t {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "other",
    }
}

/// Discrete before integrated before virtual before unknown before software.
fn rank(t: wgpu::DeviceType) -> u32 {
    match t {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

fn instance() -> wgpu::Instance {
    let mut desc = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    // Compute on OpenGL is known to be wrong on software drivers, and every adapter we want has a
    // better interface.
    desc.backends &= wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    wgpu::Instance::new(desc)
}

/// All adapters that can run kernels, best first; ties keep the driver's order.
fn candidates() -> Vec<wgpu::Adapter> {
    let instance = instance();
    let mut found: Vec<wgpu::Adapter> = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()))
        .into_iter()
        .filter(|a| {
            a.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
                && a.limits().max_storage_buffers_per_shader_stage >= 4
        })
        .collect();
    found.sort_by_key(|a| rank(a.get_info().device_type));
    found
}

/// The adapters of this machine, best first. Empty where no driver is installed.
pub(super) fn list() -> Vec<AdapterSummary> {
    candidates().iter().enumerate().map(|(i, a)| AdapterSummary::of(&a.get_info(), &a.limits(), i == 0)).collect()
}

/// The best adapter, or the best whose name contains `wanted` (case aside).
///
/// # Errors
/// [`Error::NoAdapter`] naming what was looked for and what there is.
pub(super) fn choose(wanted: Option<&str>) -> Result<wgpu::Adapter> {
    let found = candidates();
    if found.is_empty() {
        return Err(Error::NoAdapter { what: "no driver offers one".into() });
    }
    let Some(wanted) = wanted else {
        return found.into_iter().next().ok_or_else(|| Error::NoAdapter { what: "no driver offers one".into() });
    };
    let names: Vec<String> = found.iter().map(|a| format!("'{}'", a.get_info().name)).collect();
    let key = wanted.to_lowercase();
    found
        .into_iter()
        .find(|a| a.get_info().name.to_lowercase().contains(&key))
        .ok_or_else(|| Error::NoAdapter { what: format!("no name contains '{wanted}'; there is {}", names.join(", ")) })
}
