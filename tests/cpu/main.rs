//! Tests of the CPU side through the public interface, on real data where `BARYMAP_DATA` names it;
//! no graphics device is touched.

mod accuracy;
mod anchors;
mod bad_arguments;
mod browser;
#[path = "../common/mod.rs"]
mod common;
mod control;
mod embedded;
mod embedding;
mod encoding;
mod few_pairs;
mod field;
mod io;
mod models;
mod parts;
mod plane;
#[path = "../common/plane.rs"]
mod plane_cases;
mod property_1;
mod public_face;
mod render;
mod shaders;
#[path = "../common/similar.rs"]
mod similar;
mod similarity;
mod tobj_oracle;
mod transfer;
mod wrong_pairs;
