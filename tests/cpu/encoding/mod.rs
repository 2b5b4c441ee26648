//! Mean-value encoding and deformation through the public interface.

mod decode;
mod exact;
mod faults;
mod morph;
mod standard;
#[path = "../../common/tube.rs"]
mod tube;

use barymap::encoding::HierarchyOptions;
use barymap::geometry::Mesh;
use barymap::io::cache::Cache;
use barymap::tools::deform::{Deformer, Handles};

/// A deformer for the whole mesh.
pub(crate) fn deformer(mesh: &Mesh, handles: &[u32]) -> Deformer {
    let wanted = Handles { vertices: handles.to_vec(), region: None };
    Deformer::new(mesh, wanted, &HierarchyOptions::default(), &Cache::disabled()).unwrap_or_else(|e| panic!("{e}"))
}

/// `count` vertices of every component, spread over its numbering.
pub(crate) fn spread(mesh: &Mesh, count: usize) -> Vec<u32> {
    let c = barymap::encoding::Connectivity::new(mesh);
    (0..c.component_count)
        .flat_map(|k| {
            let members: Vec<u32> = (0..mesh.vertex_count() as u32).filter(|&v| c.component[v as usize] == k).collect();
            let n = count.min(members.len());
            (0..n).map(|i| members[i * members.len() / n]).collect::<Vec<_>>()
        })
        .collect()
}
