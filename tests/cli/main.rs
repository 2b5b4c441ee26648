//! The command line end to end: the built program on small meshes written for each test, and on the
//! bad files of `BARYMAP_DATA`.

mod anchors;
mod animate;
mod attributes;
mod batch;
mod cage;
mod cases;
mod decal;
mod deform;
mod docs;
mod faults;
mod finite;
mod gltf;
#[path = "../common/gltf_validator.rs"]
mod gltf_validator;
mod kinds;
mod long;
mod look;
mod lost;
mod machine;
mod map;
mod materials;
mod memory;
mod morph;
mod pairs;
mod pictures;
mod remesh;
mod similar;
mod spline;
mod steps;
mod support;
mod tables;
mod textures;
mod transfer;
mod unwrap;
mod up;
mod warp;
mod welding;
mod words;
