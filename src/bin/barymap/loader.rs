//! What the loader of graphics drivers is told before it starts.
//!
//! The Vulkan loader asks each driver for its adapters, and drivers that can also draw in windows
//! look for a display. Without `XDG_RUNTIME_DIR` the library they use for that prints a line of its
//! own to stderr for each try, which says nothing to somebody who maps a mesh.
#![allow(unsafe_code, reason = "set_var; called once, before the process has a second thread")]

/// Gives `XDG_RUNTIME_DIR` a path at which there is no display, where the environment has none.
///
/// To be called first in `main`: other threads must not read the environment meanwhile.
pub(crate) fn hush() {
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: there is no other thread yet.
        unsafe { std::env::set_var("XDG_RUNTIME_DIR", "/nonexistent") };
    }
}
