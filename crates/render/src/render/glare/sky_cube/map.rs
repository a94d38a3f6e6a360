//! The glare map of the sky: computed level by level from the light of all stars, except for the sprites, which are
//! drawn individually. Shaders: `shaders/glare/sky_cube/map_*.wgsl`.
//!
//! No twin: reference/glare/sky_cube.rs, which adds the glare source by source.

use std::{cmp::Reverse, sync::Arc};

use super::pixel_class;
use crate::render::{
    constants::{glare_map::RIM, workgroups::MAP_SIDE},
    shader::Shader,
};
use crate::{
    catalogue::chunks::StarSet,
    gpu::{self, Gpu, LayoutOf, storage_buffer},
    photometry::glare::{GlareKernel, InverseSquareKernel, split::angle_of_chord_squared},
    plan::{
        GlareMap,
        glare::sky_cube::{FarLight, Level, SkyCubePlan, SkyCubeSettings, Sprite, SpriteCell},
    },
    render::glare::layout,
    view::Viewport,
};

/// Entries of the kernel's table per octave of the squared chord, and number of octaves.
const ENTRIES_PER_OCTAVE: u32 = 16;
const OCTAVES: u32 = 48;
/// log2 of the largest squared chord.
const LAST_OCTAVE: f64 = 2.0;
/// Inputs from which a map was made.
pub(super) struct Key {
    pub(super) stars: Arc<StarSet>,
    pub(super) settings: SkyCubeSettings,
    pub(super) kernel: Arc<dyn GlareKernel>,
}

impl Key {
    /// Whether the light of all cells is the same, and only its division into sprites and bumps may differ.
    fn has_same_cells(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.stars, &other.stars)
            && Arc::ptr_eq(&self.kernel, &other.kernel)
            && self.settings.has_same_cells(&other.settings, &self.stars)
    }
}

/// Map and sprites of the sky on the adapter.
pub(super) struct Held {
    pub(super) key: Key,
    pub(super) sky: SkyCubePlan,
    pub(super) map: wgpu::Buffer,
    /// Light at the points of the finest level, without bumps.
    scattered: wgpu::Buffer,
    pub(super) sprites: wgpu::Buffer,
    /// Chords at which the sprites end, in the order of the sprites. Each is the longest chord of the sprite's reach class.
    pub(super) chords: Vec<f64>,
    /// Regions of the sky, then the cells of sprites of all regions.
    pub(super) sprite_cells: wgpu::Buffer,
    pub(super) kernel_table: wgpu::Buffer,
    /// Constant of the inverse-square kernel and square of its inner angle; `None` for other kernels.
    pub(super) inverse_square: Option<[f32; 2]>,
}

impl Held {
    /// Returns the parameters of passes that read the map and the kernel. The parameters of sprite lists are 0.
    pub(super) fn parameters(&self) -> layout::SkyCubeParameters {
        let sky = &self.sky;
        let [constant, inner_squared] = self.inverse_square.unwrap_or_default();
        layout::SkyCubeParameters {
            soft: sky.soft.coefficients.map(|coefficient| coefficient as f32),
            soft_inverse: (1.0 / sky.soft.squared) as f32,
            edge_cells: sky.light.levels[0].edge_cells,
            regions: sky.sprites.regions.len() as u32,
            constant,
            inner_squared,
            first_octave: (LAST_OCTAVE - f64::from(OCTAVES)) as f32,
            entries_per_octave: ENTRIES_PER_OCTAVE as f32,
            entries: OCTAVES * ENTRIES_PER_OCTAVE + 1,
            ..Default::default()
        }
    }

    /// Returns the parameters of a viewport whose eye has the sources `near`.
    pub(super) fn view(&self, viewport: &Viewport, near: std::ops::Range<u32>) -> layout::GlareView {
        let class = pixel_class(viewport);
        let index = self.key.settings.pixel_classes_rad.partition_point(|other| *other < class);
        let class = &self.sky.classes[index];
        layout::GlareView {
            core: class.shown.core.coefficients.map(|coefficient| coefficient as f32),
            core_squared: class.shown.core.squared as f32,
            greatest_inverse: (1.0 / class.least_squared) as f32,
            first_point: map_points(self.sky.light.levels[0].edge_cells) * index as u32,
            first_near: near.start,
            near_count: near.end - near.start,
        }
    }
}

/// Passes of a level.
pub(super) struct MapPasses {
    gather: wgpu::ComputePipeline,
    bumps: wgpu::ComputePipeline,
    sharpen: wgpu::ComputePipeline,
    /// Placeholder for a missing coarser level.
    nothing: wgpu::Buffer,
}

/// Buffers of one level.
struct LevelBuffers {
    edge_cells: u32,
    end_squared: f64,
    entries: usize,
    cells: wgpu::Buffer,
    table: wgpu::Buffer,
}

/// Returns the number of points of a finished map.
pub(super) fn map_points(edge_cells: u32) -> u32 {
    6 * (edge_cells + RIM) * (edge_cells + RIM)
}

/// Returns the largest angle between the centre of a workgroup's points and one of these points. In the plane of a face their distance is at least
/// this angle.
fn group_radius_rad(edge_cells: u32) -> f64 {
    let half_diagonal_cells = f64::from(MAP_SIDE - 1) * std::f64::consts::FRAC_1_SQRT_2;
    half_diagonal_cells * 2.0 / f64::from(edge_cells)
}

/// Returns the number of points for which a level gathers light.
fn gathered_points(edge_cells: u32) -> u32 {
    6 * (edge_cells + 2 * RIM) * (edge_cells + 2 * RIM)
}

/// Dispatches a pass over the points of all faces, `groups` by `groups` workgroups each.
fn dispatch(
    gpu: &Gpu,
    pass: &mut wgpu::ComputePass<'_>,
    pipeline: &wgpu::ComputePipeline,
    buffers: &[(u32, wgpu::BindingResource<'_>)],
    groups: u32,
) {
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &gpu.bind_once(LayoutOf::Compute(pipeline, 0), buffers), &[]);
    pass.dispatch_workgroups(groups, groups, 6);
}

impl LevelBuffers {
    fn new(gpu: &Gpu, level: &Level) -> Self {
        let cells: Vec<layout::GlareCell> = level
            .cells
            .iter()
            .map(|cell| layout::GlareCell {
                direction: cell.direction.as_vec3().to_array(),
                light: cell.light.map(|channel| channel as f32),
                ..Default::default()
            })
            .collect();
        let table: Vec<f32> = level.table.iter().map(|per_sr| *per_sr as f32).collect();
        Self {
            edge_cells: level.edge_cells,
            end_squared: level.end_squared,
            entries: level.table.len(),
            cells: gpu::storage_buffer(gpu, "glare cells", &cells),
            table: gpu::storage_buffer(gpu, "glare level kernel", &table),
        }
    }
}

/// Returns the sine of the angle from the centre of a workgroup's points beyond which no source reaches any of them; 2: there is no such angle. The
/// kernel ends at `end_squared`, the square of a chord.
fn group_end_sine(edge_cells: u32, end_squared: f64) -> f32 {
    let angle = angle_of_chord_squared(end_squared) + group_radius_rad(edge_cells);
    if angle >= std::f64::consts::FRAC_PI_2 { 2.0 } else { angle.sin() as f32 }
}

/// Creates a buffer of points.
fn points_buffer(gpu: &Gpu, label: &str, points: u32) -> wgpu::Buffer {
    gpu.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: 16 * u64::from(points),
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    })
}

impl MapPasses {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let level =
            |source| gpu.compute_pipeline(&Shader::new("glare/sky_cube/map_level").with("source", source).source());
        Self {
            gather: level("glare/sky_cube/map_kernel"),
            bumps: level("glare/sky_cube/map_bump"),
            sharpen: gpu.compute_pipeline(&Shader::new("glare/sky_cube/map_sharpen").source()),
            nothing: gpu::storage_buffer(gpu, "nothing", &[[0.0_f32; 4]]),
        }
    }

    /// Records the sum of two lights at each point of a level: the light that the level's cells scatter towards it, and the light of the coarser
    /// level. `coarser`: the sharpened points of that level, and its number of cells along an edge.
    fn gather(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        level: &LevelBuffers,
        coarser: Option<(&wgpu::Buffer, u32)>,
    ) -> wgpu::Buffer {
        let scattered = points_buffer(gpu, "glare level", gathered_points(level.edge_cells));
        let parameters = layout::GlareLevelParameters {
            edge_cells: level.edge_cells,
            coarser_cells: coarser.map_or(0, |(_, edge_cells)| edge_cells),
            end_squared: level.end_squared as f32,
            group_end_sine: group_end_sine(level.edge_cells, level.end_squared),
            entries: ((level.entries - 1) as f64 / level.end_squared) as f32,
            ..Default::default()
        };
        let parameters = gpu::uniform_buffer(gpu, "glare level parameters", &parameters);
        let buffers = [
            (0, parameters.as_entire_binding()),
            (1, level.cells.as_entire_binding()),
            (2, level.table.as_entire_binding()),
            (3, coarser.map_or(&self.nothing, |(map, _)| map).as_entire_binding()),
            (4, scattered.as_entire_binding()),
        ];
        let groups = (level.edge_cells + 2 * RIM).div_ceil(MAP_SIDE);
        dispatch(gpu, pass, &self.gather, &buffers, groups);
        scattered
    }

    /// Records the sum of the light of all levels at the points of the finest one.
    fn gather_levels(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        finest: &LevelBuffers,
        coarser_levels: &[Level],
    ) -> wgpu::Buffer {
        // Levels from the coarsest to the second finest.
        let mut coarser: Option<(wgpu::Buffer, u32)> = None;
        for level in coarser_levels.iter().rev() {
            let below = coarser.as_ref().map(|(buffer, edge)| (buffer, *edge));
            let scattered = self.gather(gpu, pass, &LevelBuffers::new(gpu, level), below);
            let made = points_buffer(gpu, "glare level", map_points(level.edge_cells));
            self.sharpen(gpu, pass, level.edge_cells, &scattered, (&made, 0));
            coarser = Some((made, level.edge_cells));
        }
        let below = coarser.as_ref().map(|(buffer, edge)| (buffer, *edge));
        self.gather(gpu, pass, finest, below)
    }

    /// Records the sum of the points of a level and of bumps around its cells. `light`: the light of each bump; `squared`: the square of the bumps'
    /// radius.
    fn add_bumps(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        level: &LevelBuffers,
        scattered: &wgpu::Buffer,
        (light, squared): (&[[f64; 3]], f64),
    ) -> wgpu::Buffer {
        let light: Vec<[f32; 4]> = light.iter().map(|c| [c[0] as f32, c[1] as f32, c[2] as f32, 0.0]).collect();
        let light = storage_buffer(gpu, "glare bumps", &light);
        let with_bumps = points_buffer(gpu, "glare level with bumps", gathered_points(level.edge_cells));
        let parameters = layout::GlareBumpParameters {
            edge_cells: level.edge_cells,
            inverse_squared: (1.0 / squared) as f32,
            group_end_sine: group_end_sine(level.edge_cells, squared),
            ..Default::default()
        };
        let parameters = gpu::uniform_buffer(gpu, "glare bump parameters", &parameters);
        let buffers = [
            (0, parameters.as_entire_binding()),
            (1, level.cells.as_entire_binding()),
            (2, light.as_entire_binding()),
            (3, scattered.as_entire_binding()),
            (4, with_bumps.as_entire_binding()),
        ];
        let groups = (level.edge_cells + 2 * RIM).div_ceil(MAP_SIDE);
        dispatch(gpu, pass, &self.bumps, &buffers, groups);
        with_bumps
    }

    /// Records the sharpening of the points of a level. They are written to `map` from `first_point` on.
    fn sharpen(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        edge_cells: u32,
        scattered: &wgpu::Buffer,
        (map, first_point): (&wgpu::Buffer, u32),
    ) {
        let parameters = layout::GlareSharpenParameters { edge_cells, first_point, ..Default::default() };
        let parameters = gpu::uniform_buffer(gpu, "glare sharpen parameters", &parameters);
        let buffers =
            [(0, parameters.as_entire_binding()), (1, scattered.as_entire_binding()), (2, map.as_entire_binding())];
        dispatch(gpu, pass, &self.sharpen, &buffers, (edge_cells + RIM).div_ceil(MAP_SIDE));
    }

    /// Computes the map. If one of the maps in `held` has the same cells, their light is not gathered again, and the stars are not binned again (except for
    /// an exact map after one of display images in space). This takes most of the time, and a change of the exposure changes only bumps and sprites.
    pub(super) fn make<'a>(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        parameters: &GlareMap,
        (key, far): (Key, &mut FarLight),
        mut held: impl Iterator<Item = &'a Held>,
    ) -> Held {
        let kernel = &*key.kernel;
        let inverse_square = parameters.inverse_square_rad.map(|inner_rad| {
            let kernel = InverseSquareKernel::new(inner_rad);
            [kernel.constant(), kernel.inner_rad() * kernel.inner_rad()].map(|value| value as f32)
        });
        far.keep_for(&key.stars, key.settings.faintest_lx);
        let same = held.find(|held| held.key.has_same_cells(&key));
        let sky = SkyCubePlan::new(&key.stars, kernel, &key.settings, same.map(|held| &held.sky), Some(far));
        let points = map_points(sky.light.levels[0].edge_cells);
        let map = points_buffer(gpu, "glare map", points * sky.classes.len() as u32);
        let finest = LevelBuffers::new(gpu, &sky.light.levels[0]);
        let scattered = match same {
            Some(held) => held.scattered.clone(),
            None => self.gather_levels(gpu, pass, &finest, &sky.light.levels[1..]),
        };
        // The finest level, with the bumps of each class of pixel size.
        for (index, class) in sky.classes.iter().enumerate() {
            let with_bumps = self.add_bumps(gpu, pass, &finest, &scattered, (&class.bumps, sky.bump_squared));
            self.sharpen(gpu, pass, finest.edge_cells, &with_bumps, (&map, points * index as u32));
        }
        // Sprites.
        let mut drawn: Vec<&Sprite> = sky.sprites.sprites.iter().collect();
        if !key.settings.is_exact() {
            // Sort the sources by reach class, so that adjacent invocations get a similar amount of work. The sort is stable, so sources of one class
            // that are adjacent on the sky stay adjacent. A view then sees all of them or none.
            drawn.sort_by_key(|sprite| Reverse(reach_class(sprite.squared)));
        }
        let chords = drawn.iter().map(|sprite| class_chord(reach_class(sprite.squared))).collect();
        let sprites: Vec<layout::GlareSprite> = drawn
            .into_iter()
            .map(|sprite| layout::GlareSprite {
                direction: sprite.direction.as_vec3().to_array(),
                inverse_squared: (1.0 / sprite.squared) as f32,
                light: sprite.light.map(|channel| channel as f32),
                whole: u32::from(sprite.whole),
            })
            .collect();
        let encode = |cell: &SpriteCell, first: u32| layout::GlareSpriteCell {
            direction: cell.direction.as_vec3().to_array(),
            // A margin: rounding to f32 must not shorten the reach.
            reach: cell.reach as f32 * 1.00001,
            first: first + cell.first,
            count: cell.count,
            ..Default::default()
        };
        let regions = &sky.sprites.regions;
        // The cells follow the regions.
        let first_cell = regions.len() as u32;
        let cells = regions.iter().map(|region| encode(region, first_cell));
        let cells = cells.chain(sky.sprites.cells.iter().map(|cell| encode(cell, 0))).collect();
        Held {
            map,
            sprites: buffer_of(gpu, "glare sprites", sprites),
            chords,
            sprite_cells: buffer_of(gpu, "glare sprite cells", cells),
            kernel_table: storage_buffer(gpu, "glare kernel", &kernel_table(kernel)),
            scattered,
            inverse_square,
            sky,
            key,
        }
    }
}

/// Returns the class of sources of similar reach. Within a class the reach varies by up to a quarter of an octave.
fn reach_class(squared: f64) -> i32 {
    (2.0 * squared.log2()).ceil() as i32
}

/// Returns the longest chord of a class.
fn class_chord(class: i32) -> f64 {
    (0.25 * f64::from(class)).exp2()
}

/// Creates a buffer of a list. An empty list gets one default item, since a binding must not be empty.
fn buffer_of<T: Default + bytemuck::NoUninit>(gpu: &Gpu, label: &str, mut items: Vec<T>) -> wgpu::Buffer {
    if items.is_empty() {
        items.push(T::default());
    }
    storage_buffer(gpu, label, &items)
}

/// Returns the table of the kernel times the squared chord, as a function of log2 of the squared chord.
fn kernel_table(kernel: &dyn GlareKernel) -> Vec<f32> {
    let first = LAST_OCTAVE - f64::from(OCTAVES);
    (0..=OCTAVES * ENTRIES_PER_OCTAVE)
        .map(|entry| (first + f64::from(entry) / f64::from(ENTRIES_PER_OCTAVE)).exp2())
        .map(|squared| (squared * kernel.per_sr(angle_of_chord_squared(squared))) as f32)
        .collect()
}
