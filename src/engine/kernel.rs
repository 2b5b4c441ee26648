//! What a kernel is: its text, what it binds, and the host twins of its structs.

use super::shader::{Composed, compose};
use crate::error::Result;

/// Invocations per workgroup of every kernel. All threads of a workgroup run on one core of a
/// software adapter, where 64 reached the highest rate; on hardware it is one or two subgroups.
pub const GROUP: u32 = 64;

/// Bytes of a uniform block, the most a downlevel device binds.
pub const UNIFORM_BLOCK: u64 = 16 * 1024;

/// One binding of a kernel, in order, after the span at binding 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// A uniform buffer of at least this many bytes.
    Uniform(u64),
    /// A storage buffer the kernel only reads.
    Read,
    /// A storage buffer the kernel writes.
    Write,
    /// A table of four-word records to look things up in: an unsigned 32-bit texture, see
    /// [`Table`](super::Table).
    Table,
    /// A two-dimensional texture with filterable floating-point values.
    Texture,
    /// A filtering sampler.
    Sampler,
    /// A texture that the kernel writes and a window shows, see [`Canvas`](super::Canvas).
    Canvas,
}

/// The host twin of a struct shared with a kernel.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Name of the struct in WGSL.
    pub name: &'static str,
    /// Size of the host type in bytes.
    pub size: usize,
    /// Name and byte offset of each member.
    pub members: &'static [(&'static str, usize)],
}

/// Describes the host twin of a WGSL struct: `layout!(Params, { count, scale })`. Both have the
/// same name and members.
#[macro_export]
#[doc(hidden)]
macro_rules! kernel_layout {
    ($t:ident, { $($member:ident),* $(,)? }) => {
        $crate::engine::Layout {
            name: stringify!($t),
            size: ::core::mem::size_of::<$t>(),
            members: &[$((stringify!($member), ::core::mem::offset_of!($t, $member))),*],
        }
    };
}
pub(super) use crate::kernel_layout as layout;

/// A compute kernel. Binding 0 of group 0 is always the [`Span`] with a dynamic offset; `bindings`
/// follow from 1.
#[derive(Clone, Copy, Debug)]
pub struct Kernel {
    /// The one name of the stage: WGSL file, host half, reference, label, test and bench.
    pub name: &'static str,
    /// The text of its own file.
    pub source: &'static str,
    /// What it binds after the span.
    pub bindings: &'static [BindingKind],
    /// Host twins of all structs it shares, the span aside.
    pub layouts: &'static [Layout],
    /// Items one invocation works on.
    pub items: u32,
    /// Override constants of this variant of the text.
    pub constants: &'static [(&'static str, f64)],
}

impl Kernel {
    /// The whole text, imports resolved.
    ///
    /// # Errors
    /// If an import is missing.
    pub fn compose(&self) -> Result<Composed> {
        compose(self.name, self.source)
    }

    /// Items a workgroup works on.
    pub fn items_per_group(&self) -> u32 {
        GROUP * self.items
    }
}

/// Which items one dispatch works on; `shaders/lib/span.wgsl` holds the twin and the meaning.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Span {
    /// First item.
    pub first: u32,
    /// One past the last item.
    pub end: u32,
    /// Invocations in one row of workgroups.
    pub row: u32,
    /// In dispatches over rows: where the first row is kept. Over runs of texels: the first row of
    /// what is read or written row after row.
    pub place: u32,
}

/// The layout of [`Span`], shared by all kernels.
pub const SPAN_LAYOUT: Layout = layout!(Span, { first, end, row, place });

impl Span {
    /// The span of `items` from `first` and the workgroup counts of its dispatch: one row while
    /// that is within `max_groups`, else the fewest rows. `None` if even a full square of groups is
    /// too few.
    pub fn grid(kernel: &Kernel, first: u32, items: u32, max_groups: u32) -> Option<(Self, [u32; 2])> {
        let groups = items.div_ceil(kernel.items_per_group()).max(1);
        let rows = groups.div_ceil(max_groups.max(1));
        if rows > max_groups {
            return None;
        }
        let columns = groups.div_ceil(rows);
        let span = Self { first, end: first.checked_add(items)?, row: columns * GROUP, place: 0 };
        Some((span, [columns, rows]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: Kernel = Kernel { name: "k", source: "", bindings: &[], layouts: &[], items: 4, constants: &[] };

    #[test]
    fn grids_cover_all_items_within_the_limit() {
        for items in [1, 255, 256, 257, 16_777_216, 16_777_217, 67_108_864] {
            let (span, [x, y]) = Span::grid(&K, 7, items, 65_535).unwrap();
            assert!(x <= 65_535 && y <= 65_535);
            assert!(u64::from(x) * u64::from(y) * u64::from(K.items_per_group()) >= u64::from(items));
            assert_eq!((span.first, span.end, span.row), (7, 7 + items, x * GROUP));
        }
        assert_eq!(Span::grid(&K, 0, 16_777_216, 65_535).unwrap().1, [32_768, 2], "4096 x 4096 texels need two rows");
        assert!(Span::grid(&K, 0, 1 << 20, 8).is_none());
        assert!(Span::grid(&K, u32::MAX, 2, 65_535).is_none());
    }
}
