//! No device: the items of `device` in a build without the feature `gpu`.
//!
//! There is no value of any of these types, so an [`Engine`] never has one, and the compiler leaves
//! out what would run on it. Host halves of kernels are the same with and without the feature.

#![allow(missing_docs, reason = "`device` documents the same items")]

use std::convert::Infallible;
use std::future::Ready;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

use bytemuck::Pod;

use super::kernel::{Kernel, UNIFORM_BLOCK};
use super::{AdapterSummary, Capabilities, Engine, EngineOptions, Traffic};
use crate::error::{Error, Result};

pub(super) fn adapters() -> Vec<AdapterSummary> {
    Vec::new()
}

impl Engine {
    /// There is no adapter to start.
    pub(super) fn on_adapter(_options: &EngineOptions, _software: bool) -> Result<Self> {
        Err(Error::NoAdapter {
            what: "barymap was built without the feature gpu".into(),
            remedy: "Build it with the feature, or use the CPU back end".into(),
        })
    }

    pub(super) async fn start_adapter(options: &EngineOptions, software: bool) -> Result<Self> {
        Self::on_adapter(options, software)
    }
}

/// Types without values; `T` and `'a` are those of their namesakes.
macro_rules! absent {
    ($($name:ident $(<$($of:tt),*>)?: $holds:ty;)*) => {$(
        #[derive(Debug)]
        pub struct $name $(<$($of),*>)? {
            #[allow(dead_code, reason = "some types have no method that would need it")]
            never: Infallible,
            _of: PhantomData<$holds>,
        }
    )*};
}

absent! {
    Gpu: ();
    Pipeline: ();
    BindGroup: ();
    Buffer<T>: fn() -> T;
    UniformBlocks<T>: fn() -> T;
    PingPong<T>: fn() -> T;
    Table: ();
    Canvas: ();
    CommandEncoder: ();
    TextureView: ();
    Pyramid: ();
    Submission: ();
    Binding<'a>: &'a ();
    Batch<'a>: &'a ();
    Staging<'a, T>: &'a fn() -> T;
    ReadbackRing<'a, T>: &'a fn() -> T;
}

impl Clone for Binding<'_> {
    fn clone(&self) -> Self {
        match self.never {}
    }
}

impl Clone for Submission {
    fn clone(&self) -> Self {
        match self.never {}
    }
}

pub trait Word: Pod + Default {}
impl Word for u8 {}
impl Word for u16 {}
impl Word for u32 {}
impl Word for f32 {}

/// Methods that nobody can call.
macro_rules! never {
    ($($(#[$a:meta])* fn $name:ident $([$($g:tt)*])? (&$self:ident $(, $p:ident: $t:ty)* $(,)?) $(-> $r:ty)?;)*) => {$(
        $(#[$a])*
        pub fn $name $(<$($g)*>)? (&$self $(, $p: $t)*) $(-> $r)? {
            $(let _ = $p;)*
            match $self.never {}
        }
    )*};
}

impl Gpu {
    never! {
        fn traffic(&self) -> Traffic;
        fn capabilities(&self) -> &Capabilities;
        fn memory_held(&self) -> u64;
        fn memory_allowed(&self) -> u64;
        fn check(&self) -> Result<()>;
        fn pipeline(&self, kernel: &'static Kernel) -> Result<Arc<Pipeline>>;
        fn compiled(&self) -> Vec<&'static str>;
        fn buffer[T: Pod](&self, label: &str, len: usize) -> Result<Buffer<T>>;
        fn upload[T: Pod](&self, label: &str, values: &[T]) -> Result<Buffer<T>>;
        fn write[T: Pod](&self, buffer: &Buffer<T>, first: usize, values: &[T]) -> Result<()>;
        fn uniform[T: Pod](&self, label: &str, value: &T) -> Result<UniformBlocks<T>>;
        fn uniform_blocks[T: Pod](&self, label: &str, values: &[T]) -> Result<UniformBlocks<T>>;
        fn write_uniform[T: Pod](&self, blocks: &UniformBlocks<T>, values: &[T]) -> Result<()>;
        fn write_table[T: Pod](&self, table: &Table, first: usize, records: &[T]) -> Result<()>;
        fn canvas(&self, label: &str, size: [u32; 2]) -> Result<Canvas>;
        fn read_canvas(&self, canvas: &Canvas) -> Result<Vec<[u8; 4]>>;
        fn bind(&self, pipeline: &Pipeline, bindings: &[Binding<'_>]) -> Result<BindGroup>;
        fn batch(&self) -> Result<Batch<'_>>;
        fn wait(&self, submission: &Submission) -> Result<()>;
        fn is_done(&self, submission: &Submission) -> Result<bool>;
        fn run(
            &self,
            pipeline: &Pipeline,
            group: &BindGroup,
            items: usize,
            done: impl FnMut(u64),
        ) -> Result<()>;
        fn slice(&self, pipeline: &Pipeline) -> u32;
        fn table[T: Pod](&self, label: &str, records: &[T]) -> Result<Table>;
        fn pyramid[T: Word](
            &self,
            label: &str,
            channels: u32,
            size: [u32; 2],
            levels: u32,
            fill: impl FnMut(u32, u32, &mut [T]),
        ) -> Result<Pyramid>;
        fn read[T: Pod](&self, from: &Buffer<T>, range: Range<usize>) -> Result<Vec<T>>;
        fn read_async[T: Pod](&self, from: &Buffer<T>, range: Range<usize>) -> Ready<Result<Vec<T>>>;
    }
}

impl Gpu {
    pub fn batch_into<'a>(&'a self, _encoder: &'a mut CommandEncoder) -> Result<Batch<'a>> {
        match self.never {}
    }
}

impl Pipeline {
    never! { fn kernel(&self) -> &'static Kernel; }
}

impl<T: Pod> Buffer<T> {
    never! {
        fn len(&self) -> usize;
        fn is_empty(&self) -> bool;
        fn bind(&self) -> Binding<'_>;
        fn bytes(&self, range: &Range<usize>) -> Result<Range<u64>>;
    }
}

impl<T: Pod> UniformBlocks<T> {
    pub const PER_BLOCK: usize = UNIFORM_BLOCK as usize / size_of::<T>();

    never! {
        fn blocks(&self) -> usize;
        fn block_len(&self, index: usize) -> usize;
        fn bind(&self, index: usize) -> Binding<'_>;
    }
}

impl<T: Pod> PingPong<T> {
    pub fn new<F>(gpu: &Gpu, _pipeline: &Pipeline, _label: &str, _len: usize, _bindings: F) -> Result<Self>
    where
        F: for<'a> Fn(&'a Buffer<T>, &'a Buffer<T>) -> Vec<Binding<'a>>,
    {
        match gpu.never {}
    }

    never! { fn newest(&self) -> &Buffer<T>; }

    pub fn step(&mut self) -> &BindGroup {
        match self.never {}
    }
}

impl Table {
    never! { fn bind(&self) -> Binding<'_>; }
}

impl Canvas {
    never! {
        fn bind(&self) -> Binding<'_>;
        fn view(&self) -> &TextureView;
        fn size(&self) -> [u32; 2];
    }
}

impl Pyramid {
    never! { fn bind(&self) -> Binding<'_>; }

    pub fn bytes<T: Word>(_size: [u32; 2], _levels: u32, _channels: u32) -> u64 {
        0
    }
}

impl Batch<'_> {
    pub fn dispatch(&mut self, _pipeline: &Pipeline, _group: &BindGroup, _items: usize) -> Result<()> {
        match self.never {}
    }

    pub fn dispatch_range(&mut self, _pipeline: &Pipeline, _group: &BindGroup, _first: u32, _items: u32) -> Result<()> {
        match self.never {}
    }

    pub fn dispatch_placed(
        &mut self,
        _pipeline: &Pipeline,
        _group: &BindGroup,
        _items: (u32, u32),
        _place: u32,
    ) -> Result<()> {
        match self.never {}
    }

    pub fn dispatch_one_group(&mut self, _pipeline: &Pipeline, _group: &BindGroup, _items: usize) -> Result<()> {
        match self.never {}
    }

    pub fn dispatch_each_group(
        &mut self,
        _pipeline: &Pipeline,
        _group: &BindGroup,
        _first: u32,
        _end: u32,
        _groups: u32,
    ) -> Result<()> {
        match self.never {}
    }

    pub fn dispatch_rows(
        &mut self,
        _pipeline: &Pipeline,
        _group: &BindGroup,
        _rows: Range<u32>,
        _width: u32,
        _place: u32,
    ) -> Result<()> {
        match self.never {}
    }

    pub fn copy<T: Pod>(
        &mut self,
        _from: &Buffer<T>,
        _from_first: usize,
        _to: &Buffer<T>,
        _to_first: usize,
        _count: usize,
    ) -> Result<()> {
        match self.never {}
    }

    pub fn clear<T>(&mut self, _buffer: &Buffer<T>) {
        match self.never {}
    }

    pub fn submit(self) -> Result<Submission> {
        match self.never {}
    }

    pub fn encode(self) -> Result<()> {
        match self.never {}
    }
}

impl<'a, T: Pod> Staging<'a, T> {
    pub fn new(gpu: &'a Gpu, _label: &str, _len: usize) -> Result<Self> {
        match gpu.never {}
    }

    pub fn record(&mut self, _batch: &mut Batch<'_>, _from: &Buffer<T>, _ranges: &[Range<usize>]) -> Result<()> {
        match self.never {}
    }

    pub fn record_all(&mut self, _batch: &mut Batch<'_>, _from: &Buffer<T>) -> Result<()> {
        match self.never {}
    }

    pub fn poll<R>(&mut self, _use: impl FnOnce(&[T]) -> R) -> Result<Option<R>> {
        match self.never {}
    }

    pub fn take<R>(&mut self, _use: impl FnOnce(&[T]) -> R) -> Result<R> {
        match self.never {}
    }
}

impl<'a, T: Pod> ReadbackRing<'a, T> {
    pub fn new(gpu: &'a Gpu, _label: &str, _depth: usize, _len: usize) -> Result<Self> {
        match gpu.never {}
    }

    never! { fn is_full(&self) -> bool; }

    pub fn push(&mut self, _batch: Batch<'_>, _from: &Buffer<T>, _range: Range<usize>) -> Result<()> {
        match self.never {}
    }

    pub fn pop(&mut self) -> Result<Option<Vec<T>>> {
        match self.never {}
    }
}
