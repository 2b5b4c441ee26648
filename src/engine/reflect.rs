//! What a kernel really declares, held against its host half. Needs no adapter: a test runs it over
//! every kernel, so that a fault shows before a user's first dispatch.

use naga::valid::{Capabilities, GlobalUse, ModuleInfo, ValidationFlags, Validator};
use naga::{
    AddressSpace, Expression, Handle, ImageClass, MathFunction, Module, ScalarKind, StorageAccess, StorageFormat, Type,
    TypeInner,
};

use super::kernel::{BindingKind, Kernel, Layout, SPAN_LAYOUT};

/// Storage buffers a downlevel device lets a kernel bind.
const MOST_STORAGE: usize = 4;

/// Bytes of workgroup memory a downlevel device has.
const MOST_WORKGROUP_MEMORY: u32 = 16_352;

/// Functions whose precision the WGSL specification leaves too loose for two devices to take the
/// same decision.
const BANNED: &[MathFunction] = &[
    MathFunction::Cos,
    MathFunction::Cosh,
    MathFunction::Sin,
    MathFunction::Sinh,
    MathFunction::Tan,
    MathFunction::Tanh,
    MathFunction::Acos,
    MathFunction::Asin,
    MathFunction::Atan,
    MathFunction::Atan2,
    MathFunction::Asinh,
    MathFunction::Acosh,
    MathFunction::Atanh,
    MathFunction::Pow,
    MathFunction::Determinant,
];

/// Everything wrong with a kernel, one sentence each; empty for a sound one.
pub fn faults(kernel: &Kernel) -> Vec<String> {
    let composed = match kernel.compose() {
        Ok(c) => c,
        Err(e) => return vec![e.to_string()],
    };
    let mut found = text_faults(&composed);
    let module = match naga::front::wgsl::parse_str(&composed.text) {
        Ok(m) => m,
        Err(e) => {
            let line = e.location(&composed.text).map_or(0, |l| l.line_number as usize);
            found.push(format!("{}: {}", composed.origin(line), e.message()));
            return found;
        }
    };
    // No capabilities: what passes runs in a browser too.
    let info = match Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module) {
        Ok(info) => info,
        Err(e) => {
            let line = e.location(&composed.text).map_or(0, |l| l.line_number as usize);
            found.push(format!("{}: {}", composed.origin(line), e.emit_to_string(&composed.text)));
            return found;
        }
    };
    match module.entry_points.as_slice() {
        [e] if e.name == "main" && e.stage == naga::ShaderStage::Compute => {}
        _ => found.push("must have one entry point, a compute function called main".into()),
    }
    let group = ("GROUP", f64::from(super::kernel::GROUP));
    let constants = [group].iter().chain(kernel.constants).map(|(name, value)| (name.to_string(), *value)).collect();
    let entry = Some((naga::ShaderStage::Compute, "main"));
    binding_faults(kernel, &module, &info, &mut found);
    layout_faults(kernel, &module, &mut found);
    match naga::back::pipeline_constants::process_overrides(&module, &info, entry, &constants) {
        Ok((module, _)) => memory_faults(&module, &mut found),
        Err(e) => found.push(format!("override constants: {e}")),
    }
    for (_, f) in module.functions.iter() {
        function_faults(f, &mut found);
    }
    for e in &module.entry_points {
        function_faults(&e.function, &mut found);
    }
    found
}

/// Loops must show their bound where they begin.
fn text_faults(composed: &super::shader::Composed) -> Vec<String> {
    let mut found = Vec::new();
    for (i, line) in composed.text.lines().enumerate() {
        let code = line.split("//").next().unwrap_or_default().trim();
        if code.starts_with("loop ") || code.starts_with("while ") {
            found.push(format!("{}: a loop without a visible bound; use for", composed.origin(i + 1)));
        }
        if code.starts_with("for ") && code.contains(";;") {
            found.push(format!("{}: a for loop without a condition", composed.origin(i + 1)));
        }
    }
    found
}

fn binding_faults(kernel: &Kernel, module: &Module, info: &ModuleInfo, found: &mut Vec<String>) {
    let entry = info.get_entry_point(0);
    let mut declared = vec![false; kernel.bindings.len() + 1];
    let mut storage = 0;
    for (handle, var) in module.global_variables.iter() {
        let name = var.name.clone().unwrap_or_default();
        let Some(at) = var.binding else { continue };
        storage += usize::from(matches!(var.space, AddressSpace::Storage { .. }));
        if at.group != 0 || at.binding as usize >= declared.len() {
            found.push(format!("binding {}.{} ({name}) is not in the host's table", at.group, at.binding));
            continue;
        }
        declared[at.binding as usize] = true;
        let usage = entry[handle];
        if usage.is_empty() {
            found.push(format!("binding {} ({name}) is never used", at.binding));
        }
        let size = module.types[var.ty].inner.size(module.to_ctx());
        let wanted = match at.binding.checked_sub(1) {
            None => BindingKind::Uniform(SPAN_LAYOUT.size as u64),
            Some(i) => kernel.bindings[i as usize],
        };
        let is = match (var.space, &module.types[var.ty].inner) {
            (AddressSpace::Uniform, _) => Some(BindingKind::Uniform(u64::from(size))),
            (AddressSpace::Storage { access }, _) if access == StorageAccess::LOAD => Some(BindingKind::Read),
            (AddressSpace::Storage { .. }, _) if usage.contains(GlobalUse::WRITE) => Some(BindingKind::Write),
            (AddressSpace::Handle, TypeInner::Image { class: ImageClass::Sampled { kind, .. }, .. }) => {
                Some(match kind {
                    ScalarKind::Uint => BindingKind::Table,
                    _ => BindingKind::Texture,
                })
            }
            (AddressSpace::Handle, TypeInner::Image { class: ImageClass::Storage { format, access }, .. })
                if *format == StorageFormat::Rgba8Unorm && *access == StorageAccess::STORE =>
            {
                Some(BindingKind::Canvas)
            }
            (AddressSpace::Handle, TypeInner::Sampler { comparison: false }) => Some(BindingKind::Sampler),
            _ => None,
        };
        if is != Some(wanted) {
            found.push(format!("binding {} ({name}) is {is:?} in the kernel, {wanted:?} on the host", at.binding));
        }
    }
    for (i, there) in declared.iter().enumerate() {
        if !there {
            found.push(format!("binding {i} of the host's table is not in the kernel"));
        }
    }
    if storage > MOST_STORAGE {
        found.push(format!("{storage} storage buffers, {MOST_STORAGE} are the most a downlevel device binds"));
    }
}

/// Structs of uniform and storage buffers against their host twins, both ways.
fn layout_faults(kernel: &Kernel, module: &Module, found: &mut Vec<String>) {
    let mut shared = Vec::new();
    for (_, var) in module.global_variables.iter() {
        if matches!(var.space, AddressSpace::Uniform | AddressSpace::Storage { .. }) {
            gather(module, var.ty, &mut shared, found);
        }
    }
    for layout in kernel.layouts {
        if !shared.iter().any(|h| module.types[*h].name.as_deref() == Some(layout.name)) {
            found.push(format!("the host describes struct {}, which the kernel does not share", layout.name));
        }
    }
    for handle in shared {
        let ty = &module.types[handle];
        let (Some(name), TypeInner::Struct { members, span }) = (&ty.name, &ty.inner) else { continue };
        let twin = kernel.layouts.iter().chain([&SPAN_LAYOUT]).find(|l| l.name == name);
        let Some(twin) = twin else {
            found.push(format!("struct {name} has no host twin"));
            continue;
        };
        let here: Vec<(&str, usize)> =
            members.iter().map(|m| (m.name.as_deref().unwrap_or_default(), m.offset as usize)).collect();
        if here != twin.members || *span as usize != twin.size {
            found.push(differs(name, *span, &here, twin));
        }
    }
}

fn differs(name: &str, span: u32, here: &[(&str, usize)], twin: &Layout) -> String {
    format!("struct {name} is {span} bytes {here:?} in the kernel, {} bytes {:?} on the host", twin.size, twin.members)
}

/// Collects the structs within a shared type and objects to types whose padding surprises.
fn gather(module: &Module, ty: Handle<Type>, shared: &mut Vec<Handle<Type>>, found: &mut Vec<String>) {
    match &module.types[ty].inner {
        TypeInner::Struct { members, .. } if !shared.contains(&ty) => {
            shared.push(ty);
            for m in members {
                gather(module, m.ty, shared, found);
            }
        }
        TypeInner::Array { base, .. } => {
            if matches!(module.types[*base].inner, TypeInner::Vector { size: naga::VectorSize::Tri, .. }) {
                found.push("an array of vec3 is shared: its elements are padded to 16 bytes".into());
            }
            gather(module, *base, shared, found);
        }
        TypeInner::Matrix { rows: naga::VectorSize::Tri, .. } => {
            found.push("a matrix with columns of three is shared: its columns are padded to 16 bytes".into());
        }
        _ => {}
    }
}

fn memory_faults(module: &Module, found: &mut Vec<String>) {
    let bytes: u32 = module
        .global_variables
        .iter()
        .filter(|(_, v)| v.space == AddressSpace::WorkGroup)
        .map(|(_, v)| module.types[v.ty].inner.size(module.to_ctx()))
        .sum();
    if bytes > MOST_WORKGROUP_MEMORY {
        found.push(format!("{bytes} bytes of workgroup memory, {MOST_WORKGROUP_MEMORY} are allowed"));
    }
}

/// Whether an expression reads an element, or a member of an element, at an index known only at run
/// time.
fn indexed(function: &naga::Function, e: Handle<Expression>) -> bool {
    match &function.expressions[e] {
        Expression::Load { pointer } => indexed(function, *pointer),
        Expression::AccessIndex { base, .. } => indexed(function, *base),
        Expression::Access { .. } => true,
        _ => false,
    }
}

fn function_faults(function: &naga::Function, found: &mut Vec<String>) {
    let name = function.name.as_deref().unwrap_or("main");
    for (_, e) in function.expressions.iter() {
        match e {
            Expression::Math { fun, .. } if BANNED.contains(fun) => {
                found.push(format!("{name} calls {fun:?}, whose precision differs between devices"));
            }
            // Both sides of a select are evaluated: an index in one of them is followed even when
            // it is not chosen.
            Expression::Select { accept, reject, .. } if indexed(function, *accept) || indexed(function, *reject) => {
                found.push(format!("{name} indexes inside select"));
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "//#import lib/span
struct P { a: vec2f, n: u32, m: u32 }
@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> p: P;
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read_write> y: array<f32>;
var<workgroup> sh: array<f32, GROUP>;
@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = invocation(span, id);
    sh[0] = p.a.x;
    for (var k = 0u; k < p.n; k++) { y[i] = sqrt(x[i]) + sh[0]; }
}
";

    #[allow(dead_code, reason = "only its layout is looked at")]
    #[repr(C)]
    struct P {
        a: [f32; 2],
        n: u32,
        m: u32,
    }

    const TWIN: &[Layout] = &[crate::kernel_layout!(P, { a, n, m })];
    const BINDINGS: &[BindingKind] = &[BindingKind::Uniform(16), BindingKind::Read, BindingKind::Write];

    fn check(source: String) -> Vec<String> {
        let source: &'static str = Box::leak(source.into_boxed_str());
        faults(&Kernel { name: "demo", source, bindings: BINDINGS, layouts: TWIN, items: 1, constants: &[] })
    }

    #[test]
    fn a_sound_kernel_has_no_faults() {
        assert_eq!(check(GOOD.into()), Vec::<String>::new());
    }

    #[test]
    fn every_kind_of_fault_is_found() {
        let cases = [
            ("a: vec2f, n: u32, m: u32", "n: u32, a: vec2f, m: u32", "struct P"),
            ("a: vec2f, n: u32, m: u32", "a: vec2f, n: u32, m: u32, k: u32", "struct P"),
            ("a: vec2f, n: u32, m: u32", "a: vec2f, n: u32, m: u32, k: mat3x3f", "matrix"),
            ("a: vec2f, n: u32, m: u32", "a: vec2f, n: u32, m: u32, k: array<vec3f, 2>", "vec3"),
            ("sqrt(x[i])", "acos(x[i])", "Acos"),
            ("sqrt(x[i])", "select(x[i], 0.0, i > 3u)", "select"),
            ("read> x", "read_write> x", "binding 2"),
            ("y[i] = sqrt(x[i]) + sh[0]", "sh[i] = y[i] + x[i]", "binding 3"),
            ("y[i] = sqrt(x[i]) + sh[0]", "y[i] = sh[0]", "never used"),
            ("@binding(3)", "@binding(4)", "not in the host's table"),
            ("array<f32, GROUP>", "array<f32, 4096>", "workgroup memory"),
            ("for (var k = 0u; k < p.n; k++)", "loop {if i > 3u {break;}", "demo.wgsl:12"),
            ("sqrt(x[i])", "sqrt(x[j])", "demo.wgsl:12"),
            ("sqrt(x[i])", "f32(f64(x[i]))", "demo.wgsl:12"),
            ("fn main", "fn other", "entry point"),
        ];
        for (from, to, word) in cases {
            assert!(GOOD.contains(from), "the sound kernel changed: {from}");
            let found = check(GOOD.replace(from, to));
            assert!(found.iter().any(|f| f.contains(word)), "{from} -> {to}: {found:?}");
        }
    }
}
