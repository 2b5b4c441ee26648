// Which items a dispatch works on. Texels are dispatched in two dimensions, because 65,535 groups
// in one are too few for a 4K atlas, and in slices, because a long dispatch is ended by desktop
// drivers. See engine::kernel::Span.

// Invocations per workgroup; the host sets it (engine::kernel::GROUP).
override GROUP: u32 = 64u;

struct Span {
    first: u32,
    end: u32,
    row: u32,
    // In dispatches over rows: where the first row is kept. Over runs: the first row of what is
    // read or written row after row.
    place: u32,
}

// The number of this invocation within the dispatch, from 0.
fn invocation(span: Span, id: vec3u) -> u32 {
    return id.y * span.row + id.x;
}
