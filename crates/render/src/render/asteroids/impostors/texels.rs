//! Processes the texels of an impostor atlas before they become textures: colour bleeding and mip levels.
//!
//! An uncovered texel takes the mean of its coloured neighbours, ring by ring outwards, within its tile. Samples
//! between texels at the limb are then as accurate as inside. Mip levels halve every tile separately, down to 2 x 2
//! texels or to an odd size; means are weighted by coverage if any texel is covered.
//!
//! No shader: works on texels on the CPU.
//! No twin: works on texels on the CPU.

/// Texel with components in the range of the textures.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(super) struct Texel {
    /// Normal, mapped from -1..1 to 0..1, and coverage.
    pub normal: [f32; 4],
    /// Albedo divided by its scale, and depth.
    pub surface: [f32; 2],
}

impl Texel {
    /// Decodes a texel from the bytes of both textures.
    #[inline]
    fn from_bytes(normal: [u8; 4], surface: [u8; 2]) -> Self {
        let [x, y, z, coverage] = normal;
        let [albedo, depth] = surface;
        let share = |byte: u8| f32::from(byte) / 255.0;
        Self { normal: [share(x), share(y), share(z), share(coverage)], surface: [share(albedo), share(depth)] }
    }

    /// Bytes of both textures.
    #[inline]
    fn to_bytes(self) -> ([u8; 4], [u8; 2]) {
        let [x, y, z, coverage] = self.normal;
        let [albedo, depth] = self.surface;
        ([byte(x), byte(y), byte(z), byte(coverage)], [byte(albedo), byte(depth)])
    }

    #[inline]
    fn coverage(&self) -> f32 {
        self.normal[3]
    }

    /// Weighted mean of the colours; coverage is 0.
    #[inline]
    fn mean(texels: &[(Self, f32)]) -> Self {
        let (mut x, mut y, mut z, mut albedo, mut depth, mut total) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (texel, weight) in texels {
            x += weight * texel.normal[0];
            y += weight * texel.normal[1];
            z += weight * texel.normal[2];
            albedo += weight * texel.surface[0];
            depth += weight * texel.surface[1];
            total += weight;
        }
        Self { normal: [x / total, y / total, z / total, 0.0], surface: [albedo / total, depth / total] }
    }
}

/// Bytes per texel of the texture of normals and of that of surfaces.
pub(super) const TEXEL_BYTES: [usize; 2] = [4, 2];

/// One level of one layer: bytes of the texture of normals (4 per texel) and of surfaces (2 per texel), row by row.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub(super) struct Level {
    pub normals: Vec<u8>,
    pub surfaces: Vec<u8>,
}

impl Level {
    /// A level with `side` x `side` texels that are all 0.
    pub(super) fn empty(side: usize) -> Self {
        let [normals, surfaces] = TEXEL_BYTES.map(|bytes| vec![0; bytes * side * side]);
        Self { normals, surfaces }
    }

    /// Bytes of the surface texture with the coverage added: albedo, depth, coverage and 0. One read then returns both
    /// depth and coverage.
    pub(super) fn surfaces_with_coverage(&self) -> Vec<u8> {
        let (normals, _) = self.normals.as_chunks::<4>();
        let (surfaces, _) = self.surfaces.as_chunks::<2>();
        let texels = surfaces.iter().zip(normals);
        let mut bytes = Vec::with_capacity(4 * surfaces.len());
        for ([albedo, depth], [.., coverage]) in texels {
            bytes.extend_from_slice(&[*albedo, *depth, *coverage, 0]);
        }
        bytes
    }

    fn from_texels(texels: &[Texel]) -> Self {
        let [mut normals, mut surfaces] = TEXEL_BYTES.map(|bytes| Vec::with_capacity(bytes * texels.len()));
        for texel in texels {
            let (normal, surface) = texel.to_bytes();
            normals.extend_from_slice(&normal);
            surfaces.extend_from_slice(&surface);
        }
        Self { normals, surfaces }
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

/// Writes the texels of a tile, row by row, into the bytes of one row of tiles. `bytes` are those of both textures, `side`
/// is the number of texels along the layer.
pub(super) fn write_tile(texels: &[Texel], px: usize, bytes: [&mut [u8]; 2], side: usize, column: usize) {
    let [normals, surfaces] = bytes;
    for (row, texels) in texels.chunks_exact(px).enumerate() {
        let first = row * side + column * px;
        for (texel, index) in texels.iter().zip(first..) {
            let (normal, surface) = texel.to_bytes();
            normals[4 * index..4 * index + 4].copy_from_slice(&normal);
            surfaces[2 * index..2 * index + 2].copy_from_slice(&surface);
        }
    }
}

#[inline]
fn byte(value: f32) -> u8 {
    // The conversion truncates and saturates.
    (value * 255.0 + 0.5) as u8
}

/// Fills in colours of the uncovered texels of a tile of `px` x `px` texels.
pub(super) fn bleed(texels: &mut [Texel], px: usize) {
    let mut has_colours: Vec<bool> = texels.iter().map(|texel| texel.coverage() > 0.0).collect();
    let mut ring: Vec<usize> = (0..px * px).filter(|i| has_colours[*i]).collect();
    let mut means: Vec<Texel> = Vec::new();
    loop {
        // Texels without a colour that touch the last ring. The first ring is all covered texels.
        let mut next: Vec<usize> = Vec::new();
        for &i in &ring {
            next.extend(around(i, px).filter(|beside| !has_colours[*beside]));
        }
        next.sort_unstable();
        next.dedup();
        ring = next;
        if ring.is_empty() {
            return;
        }
        means.clear();
        for &i in &ring {
            let mut neighbours = [(Texel::default(), 0.0); 8];
            let mut count = 0;
            for beside in around(i, px).filter(|beside| has_colours[*beside]) {
                neighbours[count] = (texels[beside], 1.0);
                count += 1;
            }
            means.push(Texel::mean(&neighbours[..count]));
        }
        for (&i, mean) in ring.iter().zip(&means) {
            texels[i] = *mean;
            has_colours[i] = true;
        }
    }
}

/// A texel of a tile and its neighbours in the tile, row by row.
#[inline]
fn around(i: usize, px: usize) -> impl Iterator<Item = usize> {
    let (column, line) = (i % px, i / px);
    let columns = column.saturating_sub(1)..(column + 2).min(px);
    (line.saturating_sub(1)..(line + 2).min(px)).flat_map(move |v| columns.clone().map(move |u| v * px + u))
}

/// Computes all levels of a layer whose finest level has `side` texels along a side.
pub(super) fn levels(finest: Level, side: u32, count: u32) -> Vec<Level> {
    let mut texels = finest.texels();
    let mut levels = vec![finest];
    let mut side = side as usize;
    for _ in 1..count {
        side /= 2;
        let finer = texels;
        texels = vec![Texel::default(); side * side];
        for (row, coarser) in texels.chunks_exact_mut(side).enumerate() {
            for (column, texel) in coarser.iter_mut().enumerate() {
                let first = row * 4 * side + column * 2;
                let [a, b] = [finer[first], finer[first + 1]];
                let [c, d] = [finer[first + 2 * side], finer[first + 2 * side + 1]];
                let coverage = (a.coverage() + b.coverage() + c.coverage() + d.coverage()) / 4.0;
                let weight = |texel: &Texel| if coverage > 0.0 { texel.coverage() } else { 1.0 };
                *texel = Texel::mean(&[(a, weight(&a)), (b, weight(&b)), (c, weight(&c)), (d, weight(&d))]);
                texel.normal[3] = coverage;
            }
        }
        levels.push(Level::from_texels(&texels));
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Texels of a tile of 8 x 8 texels; those from (2, 2) to (5, 5) have `inside`.
    fn tile(inside: Texel) -> Vec<Texel> {
        let is_inside = |i| (2..6).contains(&(i % 8)) && (2..6).contains(&(i / 8));
        (0..64).map(|i| if is_inside(i) { inside } else { Texel::default() }).collect()
    }

    fn covered(bytes: [u8; 3]) -> Texel {
        let [x, y, z] = bytes.map(|byte| f32::from(byte) / 255.0);
        Texel { normal: [x, y, z, 1.0], surface: [0.25, 0.5] }
    }

    #[test]
    fn colours_bleed_over_the_whole_tile_but_coverage_does_not() {
        let before = tile(covered([0x60, 0x40, 0x20]));
        let mut texels = before.clone();
        bleed(&mut texels, 8);
        let level = Level::from_texels(&texels);
        for (i, texel) in level.texels().iter().enumerate() {
            assert_eq!(texel.normal[3], before[i].normal[3]);
            assert_eq!(level.normals[4 * i..4 * i + 3], [0x60, 0x40, 0x20]);
            assert_eq!(level.surfaces[2 * i..2 * i + 2], [0x40, 0x80]);
        }
        // Without bleeding, texels outside would be black.
        assert_ne!(Level::from_texels(&before), level);
    }

    #[test]
    fn levels_keep_area_and_do_not_mix_tiles() {
        // Two tiles of different colours side by side, two empty ones below.
        let mut level = Level::empty(16);
        for (column, bytes) in [[0x60, 0x40, 0x20], [0xa0, 0x90, 0x80]].into_iter().enumerate() {
            let mut texels = tile(covered(bytes));
            bleed(&mut texels, 8);
            write_tile(&texels, 8, [&mut level.normals, &mut level.surfaces], 16, column);
        }
        assert_eq!((level_count(8), level_count(32), level_count(24), level_count(2)), (3, 5, 4, 1));
        let levels = levels(level, 16, 3);
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
