//! The passes of `sky_cube` before the one over pixels: the map of the sky, level by level, and the search for the sprites of
//! every block of pixels. Shaders: `shaders/glare/sky_cube/`.

use super::shared::{COLUMNS, ROWS, bind_buffers};
use crate::{
    gpu::{
        self, Gpu, Shader,
        constants::{
            glare_map::RIM,
            glare_sprites::{BLOCK_SIDE, SQUARE_BLOCKS},
            workgroups::{MAP_SIDE, SPRITE_SQUARES},
        },
        layout,
    },
    plan::glare_sky::Level,
};

/// The passes.
pub(crate) struct GlareSkyPasses {
    gather: wgpu::ComputePipeline,
    sharpen: wgpu::ComputePipeline,
    find: wgpu::ComputePipeline,
    assign: wgpu::ComputePipeline,
    /// Stands in where there is no coarser level, or there are no bumps.
    nothing: wgpu::Buffer,
}

/// A level as the adapter holds it.
pub(crate) struct LevelBuffers {
    pub edge_cells: u32,
    pub end_squared: f64,
    pub entries: usize,
    pub cells: wgpu::Buffer,
    pub table: wgpu::Buffer,
}

/// Points of a finished map.
pub(crate) fn map_points(edge_cells: u32) -> u32 {
    6 * (edge_cells + RIM) * (edge_cells + RIM)
}

impl LevelBuffers {
    pub(crate) fn new(gpu: &Gpu, level: &Level) -> Self {
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

/// Bumps of the finest level: the light of each and the square of their radius.
pub(crate) struct Bumps<'a> {
    pub light: &'a wgpu::Buffer,
    pub squared: f64,
}

impl GlareSkyPasses {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self {
            gather: gpu.compute_pipeline(&Shader::new("glare/sky_cube/map_gather").source()),
            sharpen: gpu.compute_pipeline(&Shader::new("glare/sky_cube/map_sharpen").source()),
            find: gpu.compute_pipeline(&Shader::new("glare/sky_cube/sprites_find").source()),
            assign: gpu.compute_pipeline(&Shader::new("glare/sky_cube/sprites_assign").source()),
            nothing: gpu::storage_buffer(gpu, "nothing", &[[0.0_f32; 4]]),
        }
    }

    /// Records a level on top of the coarser one, with the edge of that: into `map` from `first_point` on.
    #[expect(clippy::too_many_arguments, reason = "a pass takes its settings and its buffers")]
    pub(crate) fn level(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        level: &LevelBuffers,
        coarser: Option<(&wgpu::Buffer, u32)>,
        bumps: Option<&Bumps<'_>>,
        map: &wgpu::Buffer,
        first_point: u32,
    ) {
        let wide = level.edge_cells + 2 * RIM;
        let scattered = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("glare level"),
            size: 16 * 6 * u64::from(wide) * u64::from(wide),
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let end_angle = crate::photometry::glare::split::angle_of_chord_squared(level.end_squared);
        let reaches_all = end_angle >= std::f64::consts::FRAC_PI_2;
        let parameters = layout::GlareLevelParameters {
            edge_cells: level.edge_cells,
            coarser_cells: coarser.map_or(0, |(_, edge_cells)| edge_cells),
            end_squared: level.end_squared as f32,
            end_sine: if reaches_all { 2.0 } else { end_angle.sin() as f32 },
            entries: ((level.entries - 1) as f64 / level.end_squared) as f32,
            bump_inverse: bumps.map_or(0.0, |bumps| (1.0 / bumps.squared) as f32),
            ..Default::default()
        };
        let parameters = gpu::uniform_buffer(gpu, "glare level parameters", &parameters);
        let buffers = [
            (0, parameters.as_entire_binding()),
            (1, level.cells.as_entire_binding()),
            (2, level.table.as_entire_binding()),
            (3, bumps.map_or(&self.nothing, |bumps| bumps.light).as_entire_binding()),
            (4, coarser.map_or(&self.nothing, |(map, _)| map).as_entire_binding()),
            (5, scattered.as_entire_binding()),
        ];
        pass.set_pipeline(&self.gather);
        pass.set_bind_group(0, &bind_buffers(gpu, &self.gather, 0, &buffers), &[]);
        let groups = wide.div_ceil(MAP_SIDE);
        pass.dispatch_workgroups(groups, groups, 6);

        let parameters =
            layout::GlareSharpenParameters { edge_cells: level.edge_cells, first_point, ..Default::default() };
        let parameters = gpu::uniform_buffer(gpu, "glare sharpen parameters", &parameters);
        let buffers =
            [(0, parameters.as_entire_binding()), (1, scattered.as_entire_binding()), (2, map.as_entire_binding())];
        pass.set_pipeline(&self.sharpen);
        pass.set_bind_group(0, &bind_buffers(gpu, &self.sharpen, 0, &buffers), &[]);
        let groups = (level.edge_cells + RIM).div_ceil(MAP_SIDE);
        pass.dispatch_workgroups(groups, groups, 6);
    }

    /// Records the search for the sprites of every block, on a grid of blocks (columns, rows, tiles).
    pub(crate) fn find(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        buffers: &SpriteBuffers<'_>,
        grid: [u32; 3],
    ) {
        let [columns, rows, tiles] = square_grid(grid);
        let SpriteBuffers {
            parameters,
            viewports,
            tiles: of_tiles,
            views,
            regions,
            cells,
            sprites,
            square_lists,
            lists,
        } = *buffers;
        let bind = |pipeline: &wgpu::ComputePipeline, buffers: &[&wgpu::Buffer]| {
            let bindings: Vec<_> =
                (0..).zip(buffers.iter()).map(|(binding, buffer)| (binding, buffer.as_entire_binding())).collect();
            bind_buffers(gpu, pipeline, 0, &bindings)
        };
        pass.set_pipeline(&self.find);
        let group = bind(&self.find, &[parameters, viewports, of_tiles, views, regions, cells, sprites, square_lists]);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(columns.div_ceil(SPRITE_SQUARES), rows, tiles);
        pass.set_pipeline(&self.assign);
        let group = bind(&self.assign, &[parameters, viewports, of_tiles, views, sprites, square_lists, lists]);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(columns, rows, tiles);
    }
}

/// What the search for sprites reads, and its results.
#[derive(Clone, Copy)]
pub(crate) struct SpriteBuffers<'a> {
    pub parameters: &'a wgpu::Buffer,
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub views: &'a wgpu::Buffer,
    pub regions: &'a wgpu::Buffer,
    pub cells: &'a wgpu::Buffer,
    pub sprites: &'a wgpu::Buffer,
    pub square_lists: &'a wgpu::Buffer,
    pub lists: &'a wgpu::Buffer,
}

/// Blocks (columns, rows, tiles) of the workgroups that the passes over pixels have.
pub(crate) fn block_grid([columns, rows, tiles]: [u32; 3]) -> [u32; 3] {
    [columns * (COLUMNS / BLOCK_SIDE), rows * (ROWS / BLOCK_SIDE), tiles]
}

/// Squares of a grid of blocks.
pub(crate) fn square_grid([columns, rows, tiles]: [u32; 3]) -> [u32; 3] {
    [columns.div_ceil(SQUARE_BLOCKS), rows.div_ceil(SQUARE_BLOCKS), tiles]
}
