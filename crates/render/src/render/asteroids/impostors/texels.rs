//! Processes the texels of an impostor atlas before they become textures: colour bleeding and mip levels.
//!
//! An uncovered texel takes the mean of its coloured neighbours, ring by ring outwards, within its tile. Samples
//! between texels at the limb are then as accurate as inside. Mip levels halve every tile separately, down to 2 x 2
//! texels or to an odd size; means are weighted by coverage if any texel is covered.
//!
//! No shader: works on texels on the CPU.
//! No twin: works on texels on the CPU.

use rayon::prelude::*;

/// Texel with components in the range of the textures.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(super) struct Texel {
    /// Normal, mapped from -1..1 to 0..1, and coverage.
    pub normal: [f32; 4],
    /// Albedo divided by its scale, and depth.
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

    /// Decodes a texel from the bytes of both textures.
    fn from_bytes(normal: [u8; 4], surface: [u8; 2]) -> Self {
        Self {
            normal: normal.map(|byte| f32::from(byte) / 255.0),
            surface: surface.map(|byte| f32::from(byte) / 255.0),
        }
    }

    fn coverage(&self) -> f32 {
        self.normal[3]
    }

    /// Weighted mean of the colours; coverage is 0.
    fn mean(texels: &[(Self, f32)]) -> Self {
        let total: f32 = texels.iter().map(|(_, weight)| weight).sum();
        let mean = |part: &dyn Fn(&Self) -> f32| {
            texels.iter().map(|(texel, weight)| weight * part(texel)).sum::<f32>() / total
        };
        Self {
            normal: [mean(&|t| t.normal[0]), mean(&|t| t.normal[1]), mean(&|t| t.normal[2]), 0.0],
            surface: [mean(&|t| t.surface[0]), mean(&|t| t.surface[1])],
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
    /// Bytes of the surface texture with the coverage added: albedo, depth, coverage and 0. One read then returns both
    /// depth and coverage.
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

/// Number of mip levels of a tile with `tile_px` texels along a side.
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
    // Rows of tiles do not touch each other, so they are processed in parallel.
    texels.par_chunks_mut(side * px).for_each(|row| {
        for tile in 0..tiles as usize {
            bleed(row, tile * px, side, px);
        }
    });
    Level::from_texels(&texels)
}

/// Fills in colours of the uncovered texels of a tile. The tile's first column is `x`, in rows of `side` texels.
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

/// Computes all levels of a layer whose finest level has `side` texels along a side.
pub(super) fn levels(finest: Level, side: u32, count: u32) -> Vec<Level> {
    let mut texels = finest.texels();
    let mut levels = vec![finest];
    let mut side = side as usize;
    for _ in 1..count {
        side /= 2;
        texels = (0..side * side)
            .map(|i| {
                let first = i / side * 4 * side + i % side * 2;
                let four = [first, first + 1, first + 2 * side, first + 2 * side + 1].map(|index| texels[index]);
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

    /// Texels of tiles of 8 x 8 texels; those from (2, 2) to (5, 5) are covered by `inside`.
    fn words(tiles: u32, inside: [u32; 2]) -> Vec<[u32; 2]> {
        let side = 8 * tiles;
        (0..side * side)
            .map(|i| if (2..6).contains(&(i % side % 8)) && (2..6).contains(&(i / side % 8)) { inside } else { [0; 2] })
            .collect()
    }

    #[test]
    fn colours_bleed_over_the_whole_tile_but_coverage_does_not() {
        let level = finest_level(&words(2, [0xff20_4060, 0x8000_4000]), 2, 8);
        for (i, texel) in level.texels().iter().enumerate() {
            let inside = (2..6).contains(&(i % 16 % 8)) && (2..6).contains(&(i / 16 % 8));
            assert_eq!(texel.normal[3], f32::from(u8::from(inside)));
            assert_eq!(level.normals[4 * i..4 * i + 3], [0x60, 0x40, 0x20]);
            assert_eq!(level.surfaces[2 * i..2 * i + 2], [0x40, 0x80]);
        }
        // Without bleeding, texels outside would be black.
        let texels: Vec<Texel> = words(2, [0xff20_4060, 0x8000_4000]).into_iter().map(Texel::from_words).collect();
        assert_ne!(Level::from_texels(&texels), level);
    }

    #[test]
    fn levels_keep_area_and_do_not_mix_tiles() {
        // Two tiles of different colours side by side, two empty ones below.
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
