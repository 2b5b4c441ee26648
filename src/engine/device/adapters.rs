//! Finding adapters and saying what they are.

use super::waiting::block_on;
use crate::engine::AdapterSummary;
use crate::error::{Error, Result};

impl AdapterSummary {
    fn of(info: &wgpu::AdapterInfo, limits: &wgpu::Limits, preferred: bool) -> Self {
        Self {
            name: name(info),
            driver: driver(info),
            interface: info.backend.to_string(),
            kind: kind(info.device_type),
            software: is_software(info),
            max_storage_binding: limits.max_storage_buffer_binding_size,
            max_buffer: limits.max_buffer_size,
            preferred,
        }
    }
}

/// The name that the driver gives; browsers may give none.
pub(super) fn name(info: &wgpu::AdapterInfo) -> String {
    if info.name.is_empty() { "the browser's adapter".into() } else { info.name.clone() }
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
    desc.backends &=
        wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12 | wgpu::Backends::BROWSER_WEBGPU;
    wgpu::Instance::new(desc)
}

/// All adapters that can run kernels, best first; ties keep the driver's order.
async fn candidates() -> Vec<wgpu::Adapter> {
    let instance = instance();
    let mut found: Vec<wgpu::Adapter> = instance
        .enumerate_adapters(wgpu::Backends::all())
        .await
        .into_iter()
        .filter(|a| {
            a.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
                && a.limits().max_storage_buffers_per_shader_stage >= 4
        })
        .collect();
    found.sort_by_key(|a| rank(a.get_info().device_type));
    found
}

/// The adapters of this machine, best first. Empty where no driver is installed, and in a browser,
/// where they cannot be waited for.
pub(in crate::engine) fn list() -> Vec<AdapterSummary> {
    let found = block_on(async { Ok(candidates().await) }).unwrap_or_default();
    let taken = |i: usize, info: &wgpu::AdapterInfo| i == 0 && !is_software(info);
    found
        .iter()
        .map(|a| (a, a.get_info()))
        .enumerate()
        .map(|(i, (a, info))| AdapterSummary::of(&info, &a.limits(), taken(i, &info)))
        .collect()
}

/// Whether kernels run on the processor behind the interface.
pub(super) fn is_software(info: &wgpu::AdapterInfo) -> bool {
    info.device_type == wgpu::DeviceType::Cpu
}

/// Which adapters are looked at.
#[derive(Clone, Copy, Debug)]
pub(super) enum Wanted<'a> {
    /// The best.
    Any,
    /// The best that is no software: a software adapter runs the kernels on the same processor,
    /// slower than the processor's own code.
    Hardware,
    /// The best whose name contains this, upper and lower case alike.
    Named(&'a str),
}

/// The best adapter of those wanted.
///
/// # Errors
/// [`Error::NoAdapter`] naming what was looked for and what there is.
pub(super) async fn choose(wanted: Wanted<'_>) -> Result<wgpu::Adapter> {
    pick(candidates().await, wanted, |a| a.get_info())
}

/// The first of `found`, best first, that is wanted.
fn pick<A>(found: Vec<A>, wanted: Wanted<'_>, info: impl Fn(&A) -> wgpu::AdapterInfo) -> Result<A> {
    let names: Vec<String> = found.iter().map(|a| format!("'{}'", info(a).name)).collect();
    let fits = |info: &wgpu::AdapterInfo| match wanted {
        Wanted::Any => true,
        Wanted::Hardware => !is_software(info),
        Wanted::Named(name) => info.name.to_lowercase().contains(&name.to_lowercase()),
    };
    let (what, remedy) = match wanted {
        _ if found.is_empty() && cfg!(target_arch = "wasm32") => (
            "the browser offers none through WebGPU".to_owned(),
            "Switch WebGPU on in the browser, or use the CPU back end".to_owned(),
        ),
        _ if found.is_empty() => (
            "no driver offers one".to_owned(),
            "Install a Vulkan driver (Debian and Ubuntu: apt-get install mesa-vulkan-drivers libvulkan1) or use \
             --backend cpu"
                .to_owned(),
        ),
        Wanted::Named(name) => (
            format!("no name contains '{name}'"),
            format!("Give a part of {}, or use --backend cpu", names.join(" or ")),
        ),
        Wanted::Any | Wanted::Hardware => (
            format!("there is only software: {}", names.join(", ")),
            "--backend gpu takes it; the processor itself is faster".to_owned(),
        ),
    };
    found.into_iter().find(|a| fits(&info(a))).ok_or(Error::NoAdapter { what, remedy })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(name: &str, device_type: wgpu::DeviceType) -> wgpu::AdapterInfo {
        let mut info = wgpu::AdapterInfo::new(device_type, wgpu::Backend::Vulkan);
        info.name = name.into();
        info
    }

    #[test]
    fn software_is_taken_where_it_is_asked_for_alone() {
        let soft = || info("llvmpipe", wgpu::DeviceType::Cpu);
        let hard = || info("Fast GPU", wgpu::DeviceType::DiscreteGpu);
        let name = |found: Vec<wgpu::AdapterInfo>, wanted| pick(found, wanted, Clone::clone).map(|i| i.name);
        assert_eq!(name(vec![hard(), soft()], Wanted::Any).unwrap(), "Fast GPU");
        assert_eq!(name(vec![hard(), soft()], Wanted::Hardware).unwrap(), "Fast GPU");
        assert_eq!(name(vec![soft()], Wanted::Any).unwrap(), "llvmpipe");
        assert_eq!(name(vec![hard(), soft()], Wanted::Named("LLVM")).unwrap(), "llvmpipe");
        let says = |found, wanted| name(found, wanted).unwrap_err().to_string();
        let only_software = says(vec![soft()], Wanted::Hardware);
        assert!(only_software.contains("llvmpipe") && only_software.contains("--backend gpu"), "{only_software}");
        let unknown = says(vec![hard(), soft()], Wanted::Named("radeon"));
        assert!(unknown.contains("radeon") && unknown.contains("'Fast GPU' or 'llvmpipe'"), "{unknown}");
        assert!(!unknown.contains("Install"), "{unknown}");
        assert!(says(vec![], Wanted::Named("radeon")).contains("Install a Vulkan driver"));
    }
}
