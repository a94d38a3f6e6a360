//! Shader sources of impostors: baking their atlases, and drawing them.

use super::shaders::{
    ASTEROID, ASTEROID_INSTANCE, ASTEROID_LISTS, MATH, PROJECTION, REFLECTION, ShaderSource, VIEWPORT,
};

const BAKE: &str = include_str!("../../shaders/shared/impostor_bake.wgsl");
const IMPOSTOR: &str = include_str!("../../shaders/shared/impostor.wgsl");
const TILES: &str = include_str!("../../shaders/shared/impostor_tiles.wgsl");

/// Where the asteroids that are drawn come from: WGSL with `slot_of`, `load_asteroid`, `clip_from_view` and `faded`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AsteroidSource {
    /// The lists that culling leaves: `shaders/shared/asteroid.wgsl`.
    Lists,
    /// Given one by one, to check impostors by themselves: `shaders/shared/asteroid_given.wgsl`.
    Given,
}

impl AsteroidSource {
    fn text(self) -> [&'static str; 3] {
        match self {
            Self::Lists => [ASTEROID_INSTANCE, ASTEROID_LISTS, ASTEROID],
            Self::Given => ["", "", include_str!("../../shaders/shared/asteroid_given.wgsl")],
        }
    }

    fn module(self, name: &'static str, entry_point: &'static str, own: &str) -> ShaderSource {
        let [instance, lists, asteroid] = self.text();
        let text = [VIEWPORT, MATH, PROJECTION, REFLECTION, instance, lists, asteroid, IMPOSTOR, TILES, own].concat();
        ShaderSource { name, entry_point, text, needs_u64: false }
    }
}

/// Places the squares of impostors. Overridable constant `METHOD`: see `shaders/shared/impostor.wgsl`.
pub fn asteroid_impostor(source: AsteroidSource) -> ShaderSource {
    source.module("asteroid impostor", "place_impostor", include_str!("../../shaders/asteroid_impostor.wgsl"))
}

/// Lights them. Overridable constant `METHOD`.
pub fn asteroid_impostor_shade(source: AsteroidSource) -> ShaderSource {
    let own = include_str!("../../shaders/asteroid_impostor_shade.wgsl");
    source.module("asteroid impostor shade", "shade_impostor", own)
}

/// Places a mesh on the tiles of an atlas.
pub fn impostor_bake() -> ShaderSource {
    let text = [BAKE, include_str!("../../shaders/impostor_bake.wgsl")].concat();
    ShaderSource { name: "impostor bake", entry_point: "place_on_tile", text, needs_u64: false }
}

/// What the samples of an atlas see.
pub fn impostor_bake_sample() -> ShaderSource {
    let text = [BAKE, include_str!("../../shaders/impostor_bake_sample.wgsl")].concat();
    ShaderSource { name: "impostor bake sample", entry_point: "sample_tile", text, needs_u64: false }
}

/// Texels of an atlas from its samples.
pub fn impostor_filter() -> ShaderSource {
    let text = include_str!("../../shaders/impostor_filter.wgsl").to_owned();
    ShaderSource { name: "impostor filter", entry_point: "filter_samples", text, needs_u64: false }
}

/// All of them.
pub(super) fn sources() -> Vec<ShaderSource> {
    let mut sources = vec![impostor_bake(), impostor_bake_sample(), impostor_filter()];
    for source in [AsteroidSource::Lists, AsteroidSource::Given] {
        sources.extend([asteroid_impostor(source), asteroid_impostor_shade(source)]);
    }
    sources
}
