//! Textures of a scene's bodies, without duplicates, and their size.

use std::sync::Arc;

use crate::scene::{SceneObjects, bodies::Texture};

/// Size of the textures of a scene on the adapter, bytes, including all levels.
pub fn texture_bytes(objects: &SceneObjects) -> u64 {
    let words = |texture: &Arc<Texture>| texture.size.map(u64::from).iter().product::<u64>() * 4 / 3 + 32;
    distinct_textures(objects).iter().map(|texture| 4 * words(texture)).sum()
}

/// Distinct textures of a scene.
pub fn distinct_textures(objects: &SceneObjects) -> Vec<Arc<Texture>> {
    let mut distinct: Vec<Arc<Texture>> = Vec::new();
    for texture in objects.bodies.iter().filter_map(|body| body.surface.texture.as_ref()) {
        if !distinct.iter().any(|other| Arc::ptr_eq(other, texture)) {
            distinct.push(Arc::clone(texture));
        }
    }
    distinct
}
