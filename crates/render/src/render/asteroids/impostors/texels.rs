//! What is done to the texels of an atlas of impostors before they become textures: colours bleed outwards, and mip
//! levels.
//!
//! A texel that nothing covers takes the mean of its neighbours that have colours, ring by ring outwards, within its
//! tile: what is sampled between texels at the limb is then as right as inside. Mip levels halve every tile by itself,
//! down to 2 x 2 texels or to an odd number; means are weighted by coverage where anything is covered.

use rayon::prelude::*;

/// A texel as textures hold it.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(super) struct Texel {
    /// Normal, halved and moved to 0..1, and coverage.
    pub normal: [f32; 4],
    /// Albedo over its scale, and depth.
    pub surface: [f32; 2],
}

impl Texel {
    /// A texel from the words of `shaders/asteroids/impostors/bake_filter.wgsl`.
    pub(super) fn from_words([normal, surface]: [u32; 2]) -> Self {
        Self {
            normal: normal.to_le_bytes().map(|byte| f32::from(byte) / 255.0),
            surface: [surface & 0xffff, surface >> 16].map(|part| part as f32 / 65535.0),
        }
    }

    /// From the bytes of both textures.
    fn from_bytes(normal: [u8; 4], surface: [u8; 2]) -> Self {
        Self {
            normal: normal.map(|byte| f32::from(byte) / 255.0),
            surface: surface.map(|byte| f32::from(byte) / 255.0),
        }
    }

    fn coverage(&self) -> f32 {
        self.normal[3]
    }

    /// The weighted mean of colours; coverage is left at 0.
    fn mean(texels: &[(Self, f32)]) -> Self {
        let total: f32 = texels.iter().map(|(_, weight)| weight).sum();
        let of = |part: &dyn Fn(&Self) -> f32| {
            texels.iter().map(|(texel, weight)| weight * part(texel)).sum::<f32>() / total
        };
        Self {
            normal: [of(&|t| t.normal[0]), of(&|t| t.normal[1]), of(&|t| t.normal[2]), 0.0],
            surface: [of(&|t| t.surface[0]), of(&|t| t.surface[1])],
        }
    }
}

/// One level of one layer: bytes of the texture of normals (4 per texel) and of surfaces (2 per texel), row by row.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub(super) struct Level {
    pub normals: Vec<u8>,
    pub surfaces: Vec<u8>,
}

impl Level {
    /// Bytes of the texture of surfaces with the coverage beside them: albedo, depth, coverage and 0, so that depth and coverage are read at
    /// once.
    pub(super) fn surfaces_with_coverage(&self) -> Vec<u8> {
        let (normals, _) = self.normals.as_chunks::<4>();
        let (surfaces, _) = self.surfaces.as_chunks::<2>();
        let texels = surfaces.iter().zip(normals);
        texels.flat_map(|([albedo, depth], [.., coverage])| [*albedo, *depth, *coverage, 0]).collect()
    }

    fn from_texels(texels: &[Texel]) -> Self {
        let byte = |value: &f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
        Self {
            normals: texels.iter().flat_map(|texel| texel.normal.iter().map(byte)).collect(),
            surfaces: texels.iter().flat_map(|texel| texel.surface.iter().map(byte)).collect(),
        }
    }

    fn texels(&self) -> Vec<Texel> {
        let (normals, _) = self.normals.as_chunks::<4>();
        let (surfaces, _) = self.surfaces.as_chunks::<2>();
        normals.iter().zip(surfaces).map(|(normal, surface)| Texel::from_bytes(*normal, *surface)).collect()
    }
}

/// Mip levels of tiles of that many texels.
pub(super) fn level_count(tile_px: u32) -> u32 {
    let mut levels = 1;
    let mut side = tile_px;
    while side > 2 && side.is_multiple_of(2) {
        side /= 2;
        levels += 1;
    }
    levels
}

/// The finest level of a layer of `tiles` x `tiles` tiles, from its texels row by row.
pub(super) fn finest_level(words: &[[u32; 2]], tiles: u32, tile_px: u32) -> Level {
    let mut texels: Vec<Texel> = words.iter().map(|words| Texel::from_words(*words)).collect();
    let (side, px) = ((tiles * tile_px) as usize, tile_px as usize);
    // A row of tiles at a time: they do not touch each other.
    texels.par_chunks_mut(side * px).for_each(|row| {
        for tile in 0..tiles as usize {
            bleed(row, tile * px, side, px);
        }
    });
    Level::from_texels(&texels)
}

/// Gives colours to what is not covered of a tile whose first column is `x` of rows of `side` texels.
fn bleed(row: &mut [Texel], x: usize, side: usize, px: usize) {
    let mut has_colours: Vec<bool> = (0..px * px).map(|i| row[i / px * side + x + i % px].coverage() > 0.0).collect();
    let mut ring: Vec<(usize, Texel)> = Vec::new();
    loop {
        ring.clear();
        for i in (0..px * px).filter(|i| !has_colours[*i]) {
            let (column, line) = (i % px, i / px);
            let mut neighbours = Vec::with_capacity(8);
            for v in line.saturating_sub(1)..(line + 2).min(px) {
                for u in column.saturating_sub(1)..(column + 2).min(px) {
                    if has_colours[v * px + u] {
                        neighbours.push((row[v * side + x + u], 1.0));
                    }
                }
            }
            if !neighbours.is_empty() {
                ring.push((i, Texel::mean(&neighbours)));
            }
        }
        if ring.is_empty() {
            return;
        }
        for (i, texel) in &ring {
            row[i / px * side + x + i % px] = *texel;
            has_colours[*i] = true;
        }
    }
}

/// All levels of a layer whose finest level has `side` texels along a side.
pub(super) fn levels(finest: Level, side: u32, count: u32) -> Vec<Level> {
    let mut texels = finest.texels();
    let mut levels = vec![finest];
    let mut side = side as usize;
    for _ in 1..count {
        side /= 2;
        texels = (0..side * side)
            .map(|i| {
                let first = i / side * 4 * side + i % side * 2;
                let four = [first, first + 1, first + 2 * side, first + 2 * side + 1].map(|at| texels[at]);
                let coverage = four.iter().map(Texel::coverage).sum::<f32>() / 4.0;
                let weighted = four.map(|texel| (texel, if coverage > 0.0 { texel.coverage() } else { 1.0 }));
                let mut mean = Texel::mean(&weighted);
                mean.normal[3] = coverage;
                mean
            })
            .collect();
        levels.push(Level::from_texels(&texels));
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tile of 8 texels, covered from (2, 2) to (5, 5) by a texel of those words.
    fn words(tiles: u32, inside: [u32; 2]) -> Vec<[u32; 2]> {
        let side = 8 * tiles;
        (0..side * side)
            .map(|i| if (2..6).contains(&(i % side % 8)) && (2..6).contains(&(i / side % 8)) { inside } else { [0; 2] })
            .collect()
    }

    #[test]
    fn colours_bleed_to_the_whole_tile_and_coverage_does_not() {
        let level = finest_level(&words(2, [0xff20_4060, 0x8000_4000]), 2, 8);
        for (i, texel) in level.texels().iter().enumerate() {
            let inside = (2..6).contains(&(i % 16 % 8)) && (2..6).contains(&(i / 16 % 8));
            assert_eq!(texel.normal[3], f32::from(u8::from(inside)));
            assert_eq!(level.normals[4 * i..4 * i + 3], [0x60, 0x40, 0x20]);
            assert_eq!(level.surfaces[2 * i..2 * i + 2], [0x40, 0x80]);
        }
        // Without bleeding colours are black outside.
        let texels: Vec<Texel> = words(2, [0xff20_4060, 0x8000_4000]).into_iter().map(Texel::from_words).collect();
        assert_ne!(Level::from_texels(&texels), level);
    }

    #[test]
    fn levels_keep_area_and_do_not_mix_tiles() {
        // Two tiles of different colours side by side, two of none below.
        let mut all = words(2, [0xff20_4060, 0]);
        for (i, words) in all.iter_mut().enumerate() {
            let (right, below) = (i % 16 >= 8, i / 16 >= 8);
            if right && words[0] != 0 {
                words[0] = 0xff80_90a0;
            }
            if below {
                *words = [0; 2];
            }
        }
        assert_eq!((level_count(8), level_count(32), level_count(24), level_count(2)), (3, 5, 4, 1));
        let levels = levels(finest_level(&all, 2, 8), 16, 3);
        let area = |level: &Level, scale: f32| level.texels().iter().map(Texel::coverage).sum::<f32>() * scale;
        for (index, level) in levels.iter().enumerate() {
            let side = 16 >> index;
            assert_eq!(level.normals.len(), 4 * side * side);
            assert!((area(level, 4.0_f32.powi(index as i32)) - 32.0).abs() < 0.3);
            for i in (0..side * side / 2).filter(|i| i / side < side / 2) {
                let expected = if i % side < side / 2 { [0x60, 0x40, 0x20] } else { [0xa0, 0x90, 0x80] };
                assert_eq!(level.normals[4 * i..4 * i + 3], expected);
            }
        }
    }
}
