// Which items a compaction keeps. Twin: engine::compact::Matching.

struct Matching {
    stride: u32,
    offset: u32,
    value: u32,
    mask: u32,
}
