//! Processes the texels of an impostor atlas before they become textures: colour bleeding and mip levels.
//!
//! An uncovered texel takes the mean of its coloured neighbours, ring by ring outwards, within its tile. Samples between texels at the limb are then
//! as accurate as samples inside it. Mip levels halve every tile separately, down to 2 x 2 texels or to an odd size; means are weighted by coverage
//! if any texel is covered.
//!
//! No shader: works on texels on the CPU.
//! No twin: works on texels on the CPU.

/// Texel whose components have the value ranges of the textures.
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

    /// Returns the bytes of both textures.
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
}

/// Weighted mean of colours.
struct Mean {
    sum: Texel,
    weight: f32,
}

impl Mean {
    const EMPTY: Self = Self { sum: Texel { normal: [0.0; 4], surface: [0.0; 2] }, weight: 0.0 };

    #[inline]
    fn add(&mut self, texel: &Texel, weight: f32) {
        let Texel { normal: [x, y, z, _], surface: [albedo, depth] } = &mut self.sum;
        *x += weight * texel.normal[0];
        *y += weight * texel.normal[1];
        *z += weight * texel.normal[2];
        *albedo += weight * texel.surface[0];
        *depth += weight * texel.surface[1];
        self.weight += weight;
    }

    #[inline]
    fn texel(&self, coverage: f32) -> Texel {
        let Texel { normal: [x, y, z, _], surface: [albedo, depth] } = self.sum;
        let total = self.weight;
        Texel { normal: [x / total, y / total, z / total, coverage], surface: [albedo / total, depth / total] }
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
    /// Returns a level with `side` x `side` texels that are all 0.
    pub(super) fn empty(side: usize) -> Self {
        let [normals, surfaces] = TEXEL_BYTES.map(|bytes| vec![0; bytes * side * side]);
        Self { normals, surfaces }
    }

    /// Returns the bytes of the surface texture with the coverage added: albedo, depth, coverage and 0. One read then returns both depth and
    /// coverage.
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

    #[inline]
    fn texel(&self, index: usize) -> Texel {
        let (normals, _) = self.normals.as_chunks::<4>();
        let (surfaces, _) = self.surfaces.as_chunks::<2>();
        Texel::from_bytes(normals[index], surfaces[index])
    }
}

/// Returns the number of mip levels of a tile with `tile_px` texels along a side.
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
        let (normals, _) = normals[4 * first..4 * (first + px)].as_chunks_mut::<4>();
        let (surfaces, _) = surfaces[2 * first..2 * (first + px)].as_chunks_mut::<2>();
        for i in 0..px {
            (normals[i], surfaces[i]) = texels[i].to_bytes();
        }
    }
}

#[inline]
fn byte(value: f32) -> u8 {
    // The conversion truncates and saturates.
    (value * 255.0 + 0.5) as u8
}

/// Neighbours of a texel as column and row offsets, row by row.
const AROUND: [[isize; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

/// Fills in colours of the uncovered texels of a tile of `px` x `px` texels.
pub(super) fn bleed(texels: &mut [Texel], px: usize) {
    // There is a flag for each texel, and for a border of one texel around the tile. The border counts as reached and has no colour.
    let width = px + 2;
    let mut has_colour = vec![false; width * width];
    let mut is_reached = vec![true; width * width];
    // Texels of the last ring: each with the index of its flag and the index of its texel. The first ring is all covered texels.
    let mut ring = Vec::with_capacity(texels.len());
    for (line, texels) in texels.chunks_exact(px).enumerate() {
        let flag = (line + 1) * width + 1;
        for (column, texel) in texels.iter().enumerate() {
            let is_covered = texel.coverage() > 0.0;
            has_colour[flag + column] = is_covered;
            is_reached[flag + column] = is_covered;
            if is_covered {
                ring.push([flag + column, line * px + column]);
            }
        }
    }
    // Differences between the two indices of a texel and those of its neighbours. Negative differences wrap, and so do additions.
    let step = |x: isize, y: isize, width: usize| (y * width as isize + x) as usize;
    let steps = AROUND.map(|[x, y]| [step(x, y, width), step(x, y, px)]);
    let (mut next, mut means) = (Vec::new(), Vec::new());
    loop {
        // Texels without a colour that touch the last ring.
        for [flag, texel] in &ring {
            for [flag_step, texel_step] in &steps {
                let beside = flag.wrapping_add(*flag_step);
                if !is_reached[beside] {
                    is_reached[beside] = true;
                    next.push([beside, texel.wrapping_add(*texel_step)]);
                }
            }
        }
        ring.clear();
        std::mem::swap(&mut ring, &mut next);
        if ring.is_empty() {
            return;
        }
        for [flag, texel] in &ring {
            let mut mean = Mean::EMPTY;
            for [flag_step, texel_step] in &steps {
                if has_colour[flag.wrapping_add(*flag_step)] {
                    mean.add(&texels[texel.wrapping_add(*texel_step)], 1.0);
                }
            }
            means.push(mean.texel(0.0));
        }
        for ([flag, texel], mean) in ring.iter().zip(means.drain(..)) {
            texels[*texel] = mean;
            has_colour[*flag] = true;
        }
    }
}

/// Computes all levels of a layer whose finest level has `side` texels along a side.
pub(super) fn levels(finest: Level, side: u32, count: u32) -> Vec<Level> {
    let mut levels = vec![finest];
    let mut side = side as usize;
    let mut finer = Vec::new();
    for level in 1..count {
        side /= 2;
        let texels = if level == 1 { coarser(side, |i| levels[0].texel(i)) } else { coarser(side, |i| finer[i]) };
        levels.push(Level::from_texels(&texels));
        finer = texels;
    }
    levels
}

/// Returns the texels of a level with `side` texels along a side, from those of the next finer one.
fn coarser(side: usize, finer: impl Fn(usize) -> Texel) -> Vec<Texel> {
    let mut texels = Vec::with_capacity(side * side);
    for row in 0..side {
        for column in 0..side {
            let first = row * 4 * side + column * 2;
            let four = [finer(first), finer(first + 1), finer(first + 2 * side), finer(first + 2 * side + 1)];
            let coverage = (four[0].coverage() + four[1].coverage() + four[2].coverage() + four[3].coverage()) / 4.0;
            let mut mean = Mean::EMPTY;
            for texel in &four {
                mean.add(texel, if coverage > 0.0 { texel.coverage() } else { 1.0 });
            }
            texels.push(mean.texel(coverage));
        }
    }
    texels
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a tile of 8 x 8 texels; those from (2, 2) to (5, 5) have the value `inside`.
    fn tile(inside: Texel) -> Vec<Texel> {
        let is_inside = |i| (2..6).contains(&(i % 8)) && (2..6).contains(&(i / 8));
        (0..64).map(|i| if is_inside(i) { inside } else { Texel::default() }).collect()
    }

    fn texels_of(level: &Level) -> Vec<Texel> {
        (0..level.normals.len() / 4).map(|i| level.texel(i)).collect()
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
        for (i, texel) in texels_of(&level).iter().enumerate() {
            assert_eq!(texel.normal[3], before[i].normal[3]);
            assert_eq!(level.normals[4 * i..4 * i + 3], [0x60, 0x40, 0x20]);
            assert_eq!(level.surfaces[2 * i..2 * i + 2], [0x40, 0x80]);
        }
        // Without bleeding, texels outside the shape would be black.
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
        let area = |level: &Level, scale: f32| texels_of(level).iter().map(Texel::coverage).sum::<f32>() * scale;
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
