//! Computes the data that depends on the directions of the views: sources of each eye, lists of sprites, and the pass
//! over pixels.
//!
//! No shader: orders the passes of sprites and composite.
//! No twin: reference/glare/sky_cube.rs, which adds the glare source by source.

use super::{
    SkyCube,
    objects::{encode_near, object_sources},
    sprites::{SpriteBuffers, SpritePasses, block_grid, square_grid},
};
use crate::plan::stars::cull::MAX_VIEWPORTS;
use crate::{
    gpu::{Gpu, Variants},
    plan::{GlareMap, glare::sky_cube::FINEST_CELLS},
    render::{
        glare::composite::{GlareCompositePass, GlareSource},
        glare::layout,
        technique::{Recording, begin_pass},
    },
    units::PARSEC_M,
    view::{Viewport, projection::Projection},
};

/// Maximum number of words in the sprite list of a block, and in that of a square of blocks. A block with more sprites searches its square's list; a
/// square with more searches all sprites.
const MOST_LIST_WORDS: u32 = 256;
const MOST_SQUARE_WORDS: u32 = 2048;
/// Maximum size of the lists of all blocks and squares. If they do not fit, the lists are shorter.
const MOST_LIST_BYTES: u64 = 256 << 20;
/// Greatest pixel size of flat views, rad, for which a parabola approximates the map over eight pixels: half a cell of the map.
const MOST_FLAT_PIXEL_RAD: f64 = 0.5 * 2.0 / FINEST_CELLS as f64 / 7.0;
/// Form of the pass over pixels.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Variant {
    /// The kernel is read from a table.
    pub(super) tabulated: bool,
    /// All views are flat, with pixels far smaller than the map's cells.
    flat: bool,
}

impl Variant {
    /// Returns the form for the scattered light of a kernel in these viewports.
    pub(super) fn new(map: &GlareMap, viewports: &[Viewport]) -> Self {
        let flat = |viewport: &Viewport| {
            matches!(viewport.projection, Projection::Perspective(_) | Projection::CubeFace(_))
                && viewport.projection.middle_pixel_rad() <= MOST_FLAT_PIXEL_RAD
        };
        Self { tabulated: map.inverse_square_rad.is_none(), flat: viewports.iter().all(flat) }
    }

    /// Returns the overridable constants of the shaders.
    pub(super) fn constants(self, gpu: &Gpu) -> [(&'static str, f64); 3] {
        let constants = [("TABULATED", self.tabulated), ("FLAT", self.flat), ("ROLLED", gpu.software)];
        constants.map(|(name, value)| (name, f64::from(u8::from(value))))
    }
}

/// Returns the pass over pixels in the given form.
pub(super) fn composite(
    composites: &Variants<Variant, GlareCompositePass>,
    gpu: &Gpu,
    variant: Variant,
) -> GlareCompositePass {
    composites.get(variant, || GlareCompositePass::new(gpu, GlareSource::Sky, &variant.constants(gpu)))
}

impl SkyCube {
    /// Records the data that depends on the directions of the views, and the pass over pixels.
    pub(super) fn record_views(&mut self, recording: &mut Recording<'_>) {
        let Self { sprites, composites, held, lists, .. } = self;
        let held = held.get(recording.frame.series.slot).and_then(|[exact, _]| exact.as_ref());
        let Some(held) = held else { unreachable!("the map must be made before the views") };
        let gpu = recording.gpu;
        let sprites = sprites.get_or_init(|| SpritePasses::new(gpu));
        let plan = recording.frame.plan;
        let targets = &*recording.targets;
        let sky = &held.sky;
        let camera_pc = plan.views.camera_pc - held.key.settings.place_pc;
        // Sources of each eye, and parameters of each view.
        let mut near: Vec<layout::GlareNear> = Vec::new();
        let views: Vec<layout::GlareView> = plan
            .views
            .viewports
            .iter()
            .enumerate()
            .map(|(number, viewport)| {
                let first_near = near.len() as u32;
                let eye_pc = camera_pc + viewport.eye_offset_m / PARSEC_M;
                let stars = sky.near_for(eye_pc, plan.views.motion, plan.air.sky.as_deref());
                near.extend(stars.into_iter().map(|star| encode_near(star, 0.0, 0)));
                near.extend(object_sources(plan, number, &*held.key.kernel, true));
                held.view(viewport, first_near..near.len() as u32)
            })
            .collect();
        let views = gpu.frame_uniform_list("glare views", &views, MAX_VIEWPORTS);
        let near = gpu.frame_storage("near glare", &near);
        let composite = composite(composites, gpu, Variant::new(&plan.glare.map, &plan.views.all_viewports));
        // Sprite lists and the pass over pixels, batch by batch.
        for (number, batch) in targets.batches.iter().enumerate() {
            let blocks = block_grid(batch.grid);
            let [columns, rows, tiles] = blocks;
            let squares = square_grid(blocks);
            let count = |[columns, rows, tiles]: [u32; 3]| u64::from(columns) * u64::from(rows) * u64::from(tiles);
            // Choose lengths of the lists that fit: a quarter of the room is for squares.
            let quarter_words = gpu.max_binding_bytes().min(MOST_LIST_BYTES) / 16;
            let words = |lists: [u32; 3], room: u64, most: u32| {
                u32::try_from(room / count(lists).max(1)).map_or(most, |fitting| fitting.min(most))
            };
            let list_words = words(blocks, 3 * quarter_words, MOST_LIST_WORDS);
            let square_words = words(squares, quarter_words, MOST_SQUARE_WORDS);
            let first_list = count(squares) * u64::from(square_words);
            let parameters = layout::SkyCubeParameters {
                list_words,
                square_words,
                columns,
                rows,
                tiles,
                first_list: first_list as u32,
                ..held.parameters()
            };
            let parameters = gpu.frame_uniform("glare sky parameters", &parameters);
            let lists = lists.with_room(gpu, 4 * (first_list + count(blocks) * u64::from(list_words))).clone();
            let mut pass = begin_pass(recording.encoder, recording.timer, "glare");
            let buffers = SpriteBuffers {
                parameters: &parameters,
                viewports: &targets.viewports,
                tiles: &batch.tiles,
                views: &views,
                cells: &held.sprite_cells,
                sprites: &held.sprites,
                lists: &lists,
            };
            sprites.find(gpu, &mut pass, &buffers, blocks);
            let target = targets.picture(number);
            let source_bindings: Vec<_> =
                [&parameters, &views, &held.map, &near, &held.sprites, &held.sprite_cells, &lists, &held.kernel_table]
                    .into_iter()
                    .enumerate()
                    .map(|(binding, buffer)| (binding as u32, buffer.as_entire_binding()))
                    .collect();
            composite.record(gpu, &mut pass, plan.glare.fraction, &target, &source_bindings, batch.grid);
        }
    }
}
