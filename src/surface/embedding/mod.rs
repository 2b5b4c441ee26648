//! stub
/// Embedding.
#[derive(Debug, Clone)]
pub struct Embedding {
    /// d
    pub dimension: usize,
    /// p
    pub points: Vec<f64>,
}
