//! Engines, caches and words of options.

use std::collections::HashMap;
use std::str::FromStr;
use std::sync::{Mutex, OnceLock, PoisonError};

use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::io::Cache;
use barymap::surface::EmbeddingOptions;
use barymap::{Error, Result};
use pyo3::prelude::*;

/// Where and within what work is done: a dictionary of the Python half.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Common {
    pub(crate) backend: String,
    pub(crate) adapter: Option<String>,
    pub(crate) memory: u64,
    pub(crate) cache: bool,
}

/// By back end and adapter.
type Engines = HashMap<(String, Option<String>), Engine>;

/// Engines that were started, which live as long as the process.
static ENGINES: OnceLock<Mutex<Engines>> = OnceLock::new();

impl Common {
    /// The engine: started once for each back end and adapter.
    pub(crate) fn engine(&self) -> Result<Engine> {
        let backend: Backend = word("backend", &self.backend)?;
        let engines = ENGINES.get_or_init(Mutex::default);
        let key = (self.backend.clone(), self.adapter.clone());
        let known = engines.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        if let Some(engine) = known {
            return Ok(engine);
        }
        let engine = Engine::new(EngineOptions { backend, adapter: self.adapter.clone(), ..EngineOptions::default() })?;
        engines.lock().unwrap_or_else(PoisonError::into_inner).insert(key, engine.clone());
        Ok(engine)
    }

    /// Where costly results are kept.
    pub(crate) fn cache(&self) -> Cache {
        if self.cache { Cache::from_environment() } else { Cache::disabled() }
    }
}

/// Options of embeddings: a dictionary of the Python half.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Embedded {
    landmarks: usize,
    sampling: String,
    dimension: usize,
}

impl Embedded {
    pub(crate) fn options(&self) -> Result<EmbeddingOptions> {
        Ok(EmbeddingOptions {
            landmarks: self.landmarks,
            sampling: word("sampling", &self.sampling)?,
            dimension: self.dimension,
            ..EmbeddingOptions::default()
        })
    }
}

/// A word of an option; the error names the argument.
pub(crate) fn word<T: FromStr<Err = Error>>(argument: &str, text: &str) -> Result<T> {
    text.parse().map_err(|error| match error {
        Error::Option { what, remedy, .. } => Error::option(argument, what, remedy),
        other => other,
    })
}
