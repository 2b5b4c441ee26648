//! A device with its queue: pipelines, error scopes, the lost flag and the memory budget.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use super::counters::Counters;
use super::scopes::{Scopes, Verdicts, describe};
use super::waiting::{CAN_WAIT, block_on};
use crate::engine::Capabilities;
use crate::engine::kernel::{BindingKind, GROUP, Kernel, Span};
use crate::engine::traffic::Traffic;
use crate::error::{Error, Result};

/// A kernel's name and text, and the bits of its override constants.
type Variant = (&'static str, &'static str, Vec<u64>);

/// A device that runs kernels. All calls may come from any thread; every call fails with
/// [`Error::Device`] once the device is lost.
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) capabilities: Capabilities,
    pub(super) timeout: Duration,
    pub(super) budget: Arc<Budget>,
    pub(super) submitting: Mutex<()>,
    pub(super) counters: Counters,
    fault: Arc<OnceLock<String>>,
    verdicts: Verdicts,
    pipelines: Mutex<HashMap<Variant, Arc<Pipeline>>>,
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu").field("capabilities", &self.capabilities).finish_non_exhaustive()
    }
}

/// A compiled kernel and what it learnt about its speed.
pub struct Pipeline {
    pub(super) kernel: &'static Kernel,
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) layout: wgpu::BindGroupLayout,
    /// Picoseconds per item, 0 while unknown.
    pub(super) pace: AtomicU64,
}

impl std::fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Pipeline").field("kernel", &self.kernel.name).finish_non_exhaustive()
    }
}

impl Pipeline {
    /// The kernel this was made from.
    pub fn kernel(&self) -> &'static Kernel {
        self.kernel
    }
}

/// Device memory held and allowed, in bytes.
#[derive(Debug)]
pub(super) struct Budget {
    held: AtomicU64,
    allowed: u64,
}

impl Budget {
    /// Takes `bytes`, or says what is missing.
    pub(super) fn take(self: &Arc<Self>, what: &str, bytes: u64) -> Result<Share> {
        let before = self.held.fetch_add(bytes, Ordering::Relaxed);
        let share = Share { budget: Arc::clone(self), bytes };
        let required = before.saturating_add(bytes);
        if required > self.allowed {
            return Err(Error::Memory { what: format!("device buffer '{what}'"), required, allowed: self.allowed });
        }
        Ok(share)
    }
}

/// A part of the budget, given back when dropped.
#[derive(Debug)]
pub(super) struct Share {
    budget: Arc<Budget>,
    bytes: u64,
}

impl Drop for Share {
    fn drop(&mut self) {
        self.budget.held.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

impl Gpu {
    pub(super) fn new(
        device: wgpu::Device,
        queue: wgpu::Queue,
        capabilities: Capabilities,
        memory: Option<u64>,
        timeout: Duration,
    ) -> Self {
        Self {
            device,
            queue,
            capabilities,
            timeout,
            budget: Arc::new(Budget { held: AtomicU64::new(0), allowed: memory.unwrap_or(u64::MAX) }),
            submitting: Mutex::new(()),
            counters: Counters::default(),
            fault: Arc::new(OnceLock::new()),
            verdicts: Verdicts::default(),
            pipelines: Mutex::new(HashMap::new()),
        }
    }

    /// Keeps the first loss or stray error of a device of our own, so that the next call reports it
    /// instead of the process ending. A borrowed device keeps the callbacks of its owner.
    pub(super) fn watch(&self) {
        let fault = Arc::clone(&self.fault);
        self.device.set_device_lost_callback(move |reason, message| {
            // A second loss adds nothing to the first.
            let _ = fault.set(format!("lost ({reason:?}) {message}"));
        });
        let fault = Arc::clone(&self.fault);
        self.device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            let _ = fault.set(describe(&e));
        }));
    }

    /// What crossed between host and device so far, of all threads.
    pub fn traffic(&self) -> Traffic {
        self.counters.read()
    }

    /// What this device can do.
    pub fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    /// Bytes of device memory held by buffers and textures of this engine.
    pub fn memory_held(&self) -> u64 {
        self.budget.held.load(Ordering::Relaxed)
    }

    /// Bytes of device memory that may be held; `u64::MAX` where nothing was said.
    pub fn memory_allowed(&self) -> u64 {
        self.budget.allowed
    }

    /// Fails if the device was lost or reported a stray error.
    ///
    /// # Errors
    /// [`Error::Device`] with what the driver said.
    pub fn check(&self) -> Result<()> {
        match self.fault.get() {
            None => Ok(()),
            Some(what) => Err(Error::Device {
                what: what.clone(),
                remedy: "Start again, or use --backend cpu; if it returns, a smaller --memory makes smaller tiles"
                    .into(),
            }),
        }
    }

    /// Destroys the device: everything after fails with [`Error::Device`]. For tests of that path.
    #[doc(hidden)]
    pub fn destroy(&self) {
        self.device.destroy();
        // The callback runs inside a poll; its outcome is the loss itself.
        let _ = self.device.poll(wgpu::PollType::Poll);
        let _ = self.fault.set("destroyed".into());
    }

    /// Runs `work` and turns whatever the device objects to into an error about `what`; in a
    /// browser into one of [`Gpu::settle`].
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(super) fn scoped<T>(&self, what: &str, work: impl FnOnce() -> T) -> Result<T> {
        self.check()?;
        let scopes = Scopes::open(&self.device);
        let value = work();
        let verdict = scopes.close(what);
        if CAN_WAIT {
            block_on(verdict)?;
            self.check()?;
        } else {
            self.verdicts.keep(verdict);
        }
        Ok(value)
    }

    /// Waits until the device has said what it objects to in all work so far. Where a thread can
    /// wait it has said so before.
    ///
    /// # Errors
    /// [`Error::Device`] with the first objection.
    pub(super) async fn settle(&self) -> Result<()> {
        self.verdicts.all().await?;
        self.check()
    }

    /// The pipeline of a kernel, built at its first use.
    ///
    /// # Errors
    /// [`Error::Capability`] if the kernel binds more than the device can, [`Error::Device`] if it
    /// is refused.
    pub fn pipeline(&self, kernel: &'static Kernel) -> Result<Arc<Pipeline>> {
        self.check()?;
        let mut cache = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (kernel.name, kernel.source, kernel.constants.iter().map(|c| c.1.to_bits()).collect());
        if let Some(p) = cache.get(&key) {
            return Ok(Arc::clone(p));
        }
        let p = Arc::new(self.build(kernel)?);
        cache.insert(key, Arc::clone(&p));
        Ok(p)
    }

    /// The names of the kernels that this device has compiled, in order, variants once.
    pub fn compiled(&self) -> Vec<&'static str> {
        let cache = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let names: std::collections::BTreeSet<&'static str> = cache.keys().map(|key| key.0).collect();
        names.into_iter().collect()
    }

    fn build(&self, kernel: &'static Kernel) -> Result<Pipeline> {
        let storage =
            kernel.bindings.iter().filter(|b| matches!(b, BindingKind::Read | BindingKind::Write)).count() as u64;
        if storage > u64::from(self.capabilities.max_storage_buffers) {
            return Err(Error::Capability {
                limit: format!("storage buffers in kernel {}", kernel.name),
                required: storage,
                actual: u64::from(self.capabilities.max_storage_buffers),
            });
        }
        let composed = kernel.compose()?;
        let constants: Vec<(&str, f64)> =
            [("GROUP", f64::from(GROUP))].into_iter().chain(kernel.constants.iter().copied()).collect();
        let entries: Vec<wgpu::BindGroupLayoutEntry> = std::iter::once(entry(0, span_binding()))
            .chain(kernel.bindings.iter().zip(1..).map(|(kind, i)| entry(i, binding_type(*kind))))
            .collect();
        self.scoped(&format!("kernel {}", kernel.name), || {
            let layout = self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(kernel.name),
                entries: &entries,
            });
            let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(kernel.name),
                source: wgpu::ShaderSource::Wgsl(composed.text.into()),
            });
            let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(kernel.name),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(kernel.name),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
                cache: None,
            });
            Pipeline { kernel, pipeline, layout, pace: AtomicU64::new(0) }
        })
    }
}

fn entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

fn span_binding() -> wgpu::BindingType {
    wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: true,
        min_binding_size: wgpu::BufferSize::new(size_of::<Span>() as u64),
    }
}

fn binding_type(kind: BindingKind) -> wgpu::BindingType {
    let buffer = |ty, min| wgpu::BindingType::Buffer {
        ty,
        has_dynamic_offset: false,
        min_binding_size: wgpu::BufferSize::new(min),
    };
    match kind {
        BindingKind::Uniform(bytes) => buffer(wgpu::BufferBindingType::Uniform, bytes),
        BindingKind::Read => buffer(wgpu::BufferBindingType::Storage { read_only: true }, 0),
        BindingKind::Write => buffer(wgpu::BufferBindingType::Storage { read_only: false }, 0),
        BindingKind::Table => wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Uint,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        BindingKind::Texture => wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        BindingKind::Sampler => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
        BindingKind::Canvas => wgpu::BindingType::StorageTexture {
            access: wgpu::StorageTextureAccess::WriteOnly,
            format: wgpu::TextureFormat::Rgba8Unorm,
            view_dimension: wgpu::TextureViewDimension::D2,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_is_given_back_and_never_passed() {
        let budget = Arc::new(Budget { held: AtomicU64::new(0), allowed: 100 });
        let a = budget.take("a", 60).unwrap();
        let refused = budget.take("b", 41).unwrap_err();
        assert!(matches!(refused, Error::Memory { required: 101, allowed: 100, .. }), "{refused}");
        let b = budget.take("b", 40).unwrap();
        drop(a);
        drop(b);
        assert_eq!(budget.held.load(Ordering::Relaxed), 0);
    }
}
