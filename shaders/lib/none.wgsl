// No triangle, no vertex, no chart, no texel; geometry::NONE.
const NONE: u32 = 0xffffffffu;
