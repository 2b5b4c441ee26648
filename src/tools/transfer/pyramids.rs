//! Pyramids of pictures, made once for all transfers of a job: tiles, materials, targets.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::gpu::DevicePicture;
use super::mip::{Encoding, MipChain};
use crate::engine::{Engine, Gpu};
use crate::error::Result;
use crate::picture::Image;

/// The pyramids of pictures that were used so far, on the host and on the device of an engine.
///
/// They are the same for every transfer that reads a picture in the same way, whatever the target
/// and the part of it.
#[derive(Debug)]
pub struct Pyramids<'a> {
    engine: Engine,
    made: Mutex<Made<'a>>,
}

#[derive(Debug, Default)]
struct Made<'a> {
    chains: HashMap<Place, MipChain<'a>>,
    device: HashMap<Place, Arc<DevicePicture>>,
}

/// A picture, by its address, and how it is read. The picture is borrowed as long as its pyramid is
/// kept, so that no other one comes to lie there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Place(usize, Encoding);

impl<'a> Pyramids<'a> {
    /// None yet, for transfers where `engine` works.
    pub fn new(engine: &Engine) -> Self {
        Self { engine: engine.clone(), made: Mutex::default() }
    }

    /// Where transfers with these pyramids work.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// How many pictures have a pyramid on the host, and how many one on the device.
    pub fn count(&self) -> [usize; 2] {
        let made = self.made();
        [made.chains.len(), made.device.len()]
    }

    fn made(&self) -> MutexGuard<'_, Made<'a>> {
        self.made.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The mip chain of `image`, which repeats.
    ///
    /// # Errors
    /// As [`MipChain::new`].
    pub(super) fn chain(&self, image: &'a Image, encoding: Encoding) -> Result<MipChain<'a>> {
        let place = Place::of(image, encoding);
        if let Some(chain) = self.made().chains.get(&place) {
            return Ok(chain.clone());
        }
        let chain = MipChain::new(image, encoding)?;
        self.made().chains.insert(place, chain.clone());
        Ok(chain)
    }

    /// The picture of `chain` and its levels on `gpu`, the device of the engine.
    ///
    /// # Errors
    /// As [`DevicePicture::new`].
    pub(super) fn on_device(&self, gpu: &Gpu, chain: &MipChain<'_>) -> Result<Arc<DevicePicture>> {
        let place = Place::of(chain.image, chain.encoding);
        if let Some(picture) = self.made().device.get(&place) {
            return Ok(Arc::clone(picture));
        }
        let picture = Arc::new(DevicePicture::new(gpu, chain)?);
        self.made().device.insert(place, Arc::clone(&picture));
        Ok(picture)
    }

    /// Gives up what is on the device, where not all of it fits.
    pub(super) fn leave_device(&self) {
        self.made().device.clear();
    }
}

impl Place {
    fn of(image: &Image, encoding: Encoding) -> Self {
        Self(std::ptr::from_ref(image).addr(), encoding)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Pixels;

    #[test]
    fn a_picture_has_one_pyramid_for_each_way_it_is_read() {
        let image = |v: u8| Image::new(4, 4, 1, Pixels::U8(vec![v; 16])).unwrap();
        let (a, b) = (image(10), image(200));
        let pyramids = Pyramids::new(&Engine::cpu());
        let plain = Encoding::default();
        let light = Encoding { linear_light: true, ..plain };
        let first = pyramids.chain(&a, plain).unwrap();
        assert!(Arc::ptr_eq(&first.levels, &pyramids.chain(&a, plain).unwrap().levels));
        assert!(!Arc::ptr_eq(&first.levels, &pyramids.chain(&a, light).unwrap().levels));
        let other = pyramids.chain(&b, plain).unwrap();
        assert!((other.levels[0].texels[0] - 200.0 / 255.0).abs() < 1e-6);
        assert_eq!(pyramids.count(), [3, 0]);
    }
}
