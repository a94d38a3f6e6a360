//! Recording `sky_cube`: the map of the sky is made when the scene, the camera's place or the settings have changed, and kept
//! until they do again; what depends on where the views look is made for every frame.

use std::{
    f64::consts::PI,
    sync::{Arc, OnceLock},
};

use super::{glare::GlareFrame, record::begin_pass};
use crate::{
    catalogue::chunks::StarSet,
    gpu::{
        Gpu, GpuTimer, GrowingBuffer,
        constants::glare_clouds::{IS_CLOUD, SHARE_PARTS},
        layout, storage_buffer, uniform_buffer,
    },
    passes::{
        glare_composite::{GlareCompositePass, GlareSource},
        glare_sky::{Bumps, GlareSkyPasses, LevelBuffers, SpriteBuffers, block_grid, map_points, square_grid},
        shared::PictureTarget,
    },
    photometry::glare::{
        GlareKernel, GlareKernelError, GlareKernelName, InverseSquareKernel, split::angle_of_chord_squared,
    },
    plan::{
        glare_sky::{FINEST_CELLS, SkyGlare, SkyGlareSettings, SpriteCell, eye_class_m, map_place_pc, pixel_class_rad},
        object_glare::{Cloud, PointOfLight},
        settings::{GlareSettings, RenderSettings},
    },
    relativity::Motion,
    scene::SceneSnapshot,
    units::{PARSEC_M, illuminance_lx_from_magnitude},
    view::{Viewport, projection::Projection},
};

/// Words of the list of sprites of a block, and of a square of blocks: a block with more sprites looks through those of its
/// square, a square with more through all.
const MOST_LIST_WORDS: u32 = 256;
const MOST_SQUARE_WORDS: u32 = 2048;
/// Bytes that the lists of all blocks, and those of all squares, may take: beyond that they are shorter.
const MOST_LIST_BYTES: u64 = 256 << 20;
/// Pixels of flat views up to which eight of them see the map as a parabola: half a cell of it, rad.
const MOST_FLAT_PIXEL_RAD: f64 = 0.5 * 2.0 / FINEST_CELLS as f64 / 7.0;
/// Entries of the kernel's table per octave of the square of the chord, and octaves.
const ENTRIES_PER_OCTAVE: u32 = 16;
const OCTAVES: u32 = 48;
/// Largest binary logarithm of the square of a chord.
const LAST_OCTAVE: f64 = 2.0;
/// Stars and camera of a frame.
pub(super) struct SkyScene<'a> {
    pub stars: &'a Arc<StarSet>,
    pub camera_pc: glam::DVec3,
    pub motion: Option<Motion>,
    pub faintest_lx: f64,
    /// What a source may add to the veil around it without being drawn by itself, relative.
    pub tolerance: f64,
}

impl<'a> SkyScene<'a> {
    pub(super) fn of(snapshot: &'a SceneSnapshot, settings: &RenderSettings) -> Self {
        Self {
            stars: &snapshot.stars,
            camera_pc: snapshot.camera.position_m / PARSEC_M,
            motion: Motion::new(snapshot.camera.velocity_c),
            faintest_lx: illuminance_lx_from_magnitude(settings.stars.magnitude_limit),
            tolerance: settings.accuracy.glare,
        }
    }

    /// What the map of these views is made of.
    fn settings(&self, views: &Views) -> SkyGlareSettings {
        let place_pc = map_place_pc(self.camera_pc);
        let camera_m = ((self.camera_pc - place_pc) * PARSEC_M).length();
        SkyGlareSettings {
            place_pc,
            motion: self.motion,
            faintest_lx: self.faintest_lx,
            farthest_eye_pc: eye_class_m(camera_m + views.farthest_eye_m) / PARSEC_M,
            tolerance: self.tolerance,
            pixel_classes_rad: views.pixel_classes_rad.clone(),
        }
    }
}

/// What of views the map depends on.
struct Views {
    /// See [`SkyGlareSettings::pixel_classes_rad`].
    pixel_classes_rad: Vec<f64>,
    /// Distance from the camera to the farthest eye, m.
    farthest_eye_m: f64,
}

impl Views {
    fn of(viewports: &[Viewport]) -> Self {
        let mut classes: Vec<f64> = viewports.iter().map(pixel_class).collect();
        classes.sort_by(f64::total_cmp);
        classes.dedup();
        let eyes = viewports.iter().map(|viewport| viewport.eye_offset_m.length());
        Self { pixel_classes_rad: classes, farthest_eye_m: eyes.fold(0.0, f64::max) }
    }
}

/// What the map was made of.
struct Key {
    stars: Arc<StarSet>,
    settings: SkyGlareSettings,
    kernel: Arc<dyn GlareKernel>,
}

/// The sky that glares, on the adapter.
struct Held {
    key: Key,
    sky: SkyGlare,
    map: wgpu::Buffer,
    sprites: wgpu::Buffer,
    sprite_cells: wgpu::Buffer,
    regions: wgpu::Buffer,
    kernel_table: wgpu::Buffer,
    /// Constant of the inverse square and the square of its inner angle; `None` for other kernels.
    inverse_square: Option<[f32; 2]>,
}

/// Forms of the pass over pixels.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Variant {
    /// The kernel is read from a table.
    tabulated: bool,
    /// All views are flat, with pixels far smaller than the cells of the map.
    flat: bool,
}

/// Passes and buffers, made when they are first asked for.
pub(super) struct GlareSky {
    passes: OnceLock<GlareSkyPasses>,
    composites: Vec<(Variant, GlareCompositePass)>,
    /// The kernel last asked for, with what it was made from.
    kernel: Option<(GlareSettings, Arc<dyn GlareKernel>)>,
    held: Option<Held>,
    /// Of the last frame.
    views: Option<Views>,
    lists: GrowingBuffer,
    square_lists: GrowingBuffer,
}

fn pixel_class(viewport: &Viewport) -> f64 {
    pixel_class_rad(viewport.projection.middle_pixel_rad())
}

/// Chord of an angle, rad.
fn chord(angle_rad: f64) -> f64 {
    2.0 * (0.5 * angle_rad.min(PI)).sin()
}

/// A source of one eye.
fn encode_near((direction, light): PointOfLight, reach: f64, parts: u32) -> layout::GlareNear {
    layout::GlareNear {
        direction: direction.as_vec3().to_array(),
        reach: reach as f32,
        light: light.map(|channel| channel as f32),
        parts,
    }
}

/// A cloud of one eye: as wide as the kernel's core at least, so that its own image has a width.
fn encode_cloud(cloud: &Cloud, kernel: &dyn GlareKernel) -> layout::GlareNear {
    let radius_rad = cloud.radius_rad.max(kernel.inner_rad());
    // The softened kernel leaves out what the kernel has within the radius.
    let share = (kernel.share_within(radius_rad).clamp(0.0, 1.0) * f64::from(SHARE_PARTS)).round() as u32;
    encode_near((cloud.direction, cloud.light), chord(radius_rad).powi(2), IS_CLOUD | share)
}

/// A buffer of a list, with one item of nothing if it is empty: a binding must hold one at least.
fn buffer_of<T: Default + bytemuck::NoUninit>(gpu: &Gpu, label: &str, mut items: Vec<T>) -> wgpu::Buffer {
    if items.is_empty() {
        items.push(T::default());
    }
    storage_buffer(gpu, label, &items)
}

/// The kernel times the square of the chord, over the binary logarithm of that square.
fn kernel_table(kernel: &dyn GlareKernel) -> Vec<f32> {
    let first = LAST_OCTAVE - f64::from(OCTAVES);
    (0..=OCTAVES * ENTRIES_PER_OCTAVE)
        .map(|entry| (first + f64::from(entry) / f64::from(ENTRIES_PER_OCTAVE)).exp2())
        .map(|squared| (squared * kernel.per_sr(angle_of_chord_squared(squared))) as f32)
        .collect()
}

impl GlareSky {
    pub(super) fn new() -> Self {
        Self {
            passes: OnceLock::new(),
            composites: Vec::new(),
            kernel: None,
            held: None,
            views: None,
            lists: GrowingBuffer::new("glare lists", wgpu::BufferUsages::STORAGE),
            square_lists: GrowingBuffer::new("glare square lists", wgpu::BufferUsages::STORAGE),
        }
    }

    /// See [`super::glare::Glare::hold_kernel`].
    pub(super) fn hold_kernel(&mut self, settings: &GlareSettings) -> Result<(), GlareKernelError> {
        // What the kernel does not depend on is left out.
        let GlareSettings { method, fraction, absolute, weights, .. } = GlareSettings::default();
        let of_kernel = GlareSettings { method, fraction, absolute, weights, ..settings.clone() };
        if self.kernel.as_ref().is_none_or(|(of, _)| *of != of_kernel) {
            self.kernel = Some((of_kernel, settings.kernel()?));
        }
        Ok(())
    }

    /// The kernel that is held.
    pub(super) fn kernel(&self) -> Option<&dyn GlareKernel> {
        self.kernel.as_ref().map(|(_, kernel)| &**kernel)
    }

    /// Lets go of buffers.
    pub(super) fn release(&mut self) {
        self.held = None;
        self.lists.release();
        self.square_lists.release();
    }

    /// Records the glare of a frame.
    pub(super) fn record(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        frame: &GlareFrame<'_>,
        scene: &SkyScene<'_>,
    ) {
        let views = Views::of(frame.viewports);
        let settings = scene.settings(&views);
        self.views = Some(views);
        if !self.holds(scene, &settings) {
            let mut pass = begin_pass(encoder, timer, "glare");
            self.hold_new(gpu, &mut pass, frame.settings, scene, settings);
        }
        self.record_views(gpu, encoder, timer, frame, scene);
    }

    /// Makes the map of a scene that has changed before it is known where the views look, as they were in the last frame: that
    /// is when it takes its time, not between the poses of a headset and its picture.
    pub(super) fn hold_map(&mut self, gpu: &Gpu, glare: &GlareSettings, scene: &SkyScene<'_>) {
        let Some(settings) = self.views.as_ref().map(|views| scene.settings(views)) else { return };
        if self.holds(scene, &settings) {
            return;
        }
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("glare map") });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        self.hold_new(gpu, &mut pass, glare, scene, settings);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
    }

    /// The kernel of the frame.
    fn kernel_in_use(&self) -> &Arc<dyn GlareKernel> {
        &self.kernel.as_ref().expect("the kernel is held before a map is made or a frame recorded").1
    }

    /// Whether the map that is held is one of these settings.
    fn holds(&self, scene: &SkyScene<'_>, settings: &SkyGlareSettings) -> bool {
        self.held.as_ref().is_some_and(|held| {
            let Key { stars, settings: of, kernel } = &held.key;
            Arc::ptr_eq(stars, scene.stars) && of == settings && Arc::ptr_eq(kernel, self.kernel_in_use())
        })
    }

    fn hold_new(
        &mut self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        glare: &GlareSettings,
        scene: &SkyScene<'_>,
        settings: SkyGlareSettings,
    ) {
        // Gone before its successor is made, so that both never exist at once.
        self.held = None;
        let key = Key { stars: Arc::clone(scene.stars), settings, kernel: Arc::clone(self.kernel_in_use()) };
        self.held = Some(self.make(gpu, pass, glare, key));
    }

    /// Makes the map.
    fn make(&self, gpu: &Gpu, pass: &mut wgpu::ComputePass<'_>, glare: &GlareSettings, key: Key) -> Held {
        let kernel = &*key.kernel;
        let inverse_square = (glare.kernel == GlareKernelName::InverseSquare).then(|| {
            let kernel = InverseSquareKernel::new(glare.inner_deg.to_radians());
            [kernel.constant(), kernel.inner_rad() * kernel.inner_rad()].map(|value| value as f32)
        });
        let sky = SkyGlare::new(&key.stars, kernel, &key.settings);
        let passes = self.passes.get_or_init(|| GlareSkyPasses::new(gpu));
        let points = map_points(sky.levels[0].edge_cells);
        let buffer = |label, points: u32| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: 16 * u64::from(points),
                usage: wgpu::BufferUsages::STORAGE,
                mapped_at_creation: false,
            })
        };
        let map = buffer("glare map", points * sky.classes.len() as u32);
        let mut coarser: Option<(wgpu::Buffer, u32)> = None;
        for level in sky.levels[1..].iter().rev() {
            let made = buffer("glare level", map_points(level.edge_cells));
            let below = coarser.as_ref().map(|(buffer, edge)| (buffer, *edge));
            passes.level(gpu, pass, &LevelBuffers::new(gpu, level), below, None, &made, 0);
            coarser = Some((made, level.edge_cells));
        }
        let finest = LevelBuffers::new(gpu, &sky.levels[0]);
        let below = coarser.as_ref().map(|(buffer, edge)| (buffer, *edge));
        for (index, class) in sky.classes.iter().enumerate() {
            let light: Vec<[f32; 4]> =
                class.bumps.iter().map(|light| [light[0] as f32, light[1] as f32, light[2] as f32, 0.0]).collect();
            let light = storage_buffer(gpu, "glare bumps", &light);
            let bumps = Bumps { light: &light, squared: sky.bump_squared };
            passes.level(gpu, pass, &finest, below, Some(&bumps), &map, points * index as u32);
        }
        let sprites: Vec<layout::GlareSprite> = sky
            .sprites
            .sprites
            .iter()
            .map(|sprite| layout::GlareSprite {
                direction: sprite.direction.as_vec3().to_array(),
                inverse_squared: (1.0 / sprite.squared) as f32,
                light: sprite.light.map(|channel| channel as f32),
                whole: u32::from(sprite.whole),
            })
            .collect();
        let encoded_cells = |cells: &[SpriteCell]| -> Vec<layout::GlareSpriteCell> {
            let encode = |cell: &SpriteCell| layout::GlareSpriteCell {
                direction: cell.direction.as_vec3().to_array(),
                // f32 must not make it shorter.
                reach: cell.reach as f32 * 1.00001,
                first: cell.first,
                count: cell.count,
                ..Default::default()
            };
            cells.iter().map(encode).collect()
        };
        Held {
            map,
            sprites: buffer_of(gpu, "glare sprites", sprites),
            sprite_cells: buffer_of(gpu, "glare sprite cells", encoded_cells(&sky.sprites.cells)),
            regions: buffer_of(gpu, "glare sprite regions", encoded_cells(&sky.sprites.regions)),
            kernel_table: storage_buffer(gpu, "glare kernel", &kernel_table(kernel)),
            inverse_square,
            sky,
            key,
        }
    }

    /// Records what depends on where the views look.
    fn record_views(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        frame: &GlareFrame<'_>,
        scene: &SkyScene<'_>,
    ) {
        let Self { passes, composites, held, lists, square_lists, .. } = self;
        let (Some(passes), Some(held)) = (passes.get(), held.as_ref()) else {
            unreachable!("the map is made before the views")
        };
        let sky = &held.sky;
        let camera_pc = scene.camera_pc - held.key.settings.place_pc;
        let mut near: Vec<layout::GlareNear> = Vec::new();
        let views: Vec<layout::GlareView> = frame
            .viewports
            .iter()
            .enumerate()
            .map(|(number, viewport)| {
                let class = pixel_class(viewport);
                let index = held.key.settings.pixel_classes_rad.partition_point(|other| *other < class);
                let first_near = near.len() as u32;
                for (direction, light) in sky.near_for(camera_pc + viewport.eye_offset_m / PARSEC_M, scene.motion) {
                    near.push(encode_near((direction, light), 0.0, 0));
                }
                for source in frame.object_sources.get(number).into_iter().flatten() {
                    near.push(encode_near(source.whole, chord(source.reach_rad), source.parts.len() as u32));
                    let soft = chord(source.soft_rad).powi(2);
                    near.extend(source.parts.iter().map(|part| encode_near(*part, soft, 0)));
                }
                for cloud in frame.clouds.get(number).into_iter().flatten() {
                    near.push(encode_cloud(cloud, &*held.key.kernel));
                }
                let class = &sky.classes[index];
                layout::GlareView {
                    core: class.shown.core.coefficients.map(|coefficient| coefficient as f32),
                    core_squared: class.shown.core.squared as f32,
                    greatest_inverse: (1.0 / class.least_squared) as f32,
                    first_point: map_points(sky.levels[0].edge_cells) * index as u32,
                    first_near,
                    near_count: near.len() as u32 - first_near,
                }
            })
            .collect();
        let views = storage_buffer(gpu, "glare views", &views);
        let near = buffer_of(gpu, "near glare", near);
        let flat = |viewport: &Viewport| {
            matches!(viewport.projection, Projection::Perspective(_) | Projection::CubeFace(_))
                && viewport.projection.middle_pixel_rad() <= MOST_FLAT_PIXEL_RAD
        };
        let variant = Variant { tabulated: held.inverse_square.is_none(), flat: frame.viewports.iter().all(flat) };
        if composites.iter().all(|(of, _)| *of != variant) {
            let constants = [("TABULATED", variant.tabulated), ("FLAT", variant.flat)];
            let constants = constants.map(|(name, value)| (name, f64::from(u8::from(value))));
            composites.push((variant, GlareCompositePass::new(gpu, GlareSource::Sky, &constants)));
        }
        let (_, composite) = composites.iter().find(|(of, _)| *of == variant).expect("it was made above");
        let [constant, inner_squared] = held.inverse_square.unwrap_or_default();
        for batch in &frame.batches {
            let blocks = block_grid(batch.grid);
            let [columns, rows, tiles] = blocks;
            let squares = square_grid(blocks);
            let count = |[columns, rows, tiles]: [u32; 3]| u64::from(columns) * u64::from(rows) * u64::from(tiles);
            // As many as fit.
            let words = |lists: [u32; 3], most: u32| {
                let fitting = gpu.max_binding_bytes().min(MOST_LIST_BYTES) / 4 / count(lists).max(1);
                u32::try_from(fitting).map_or(most, |fitting| fitting.min(most))
            };
            let list_words = words(blocks, MOST_LIST_WORDS);
            let square_words = words(squares, MOST_SQUARE_WORDS);
            let parameters = layout::GlareSkyParameters {
                soft: sky.soft.coefficients.map(|coefficient| coefficient as f32),
                soft_inverse: (1.0 / sky.soft.squared) as f32,
                edge_cells: sky.levels[0].edge_cells,
                regions: sky.sprites.regions.len() as u32,
                constant,
                inner_squared,
                first_octave: (LAST_OCTAVE - f64::from(OCTAVES)) as f32,
                entries_per_octave: ENTRIES_PER_OCTAVE as f32,
                entries: OCTAVES * ENTRIES_PER_OCTAVE + 1,
                list_words,
                square_words,
                columns,
                rows,
                tiles,
                flatness: sky.fade.flatness as f32,
                ..Default::default()
            };
            let parameters = uniform_buffer(gpu, "glare sky parameters", &parameters);
            let lists = lists.with_room(gpu, 4 * count(blocks) * u64::from(list_words)).clone();
            let square_lists = square_lists.with_room(gpu, 4 * count(squares) * u64::from(square_words)).clone();
            let mut pass = begin_pass(encoder, timer, "glare");
            let buffers = SpriteBuffers {
                parameters: &parameters,
                viewports: frame.encoded_viewports,
                tiles: batch.tiles,
                views: &views,
                regions: &held.regions,
                cells: &held.sprite_cells,
                sprites: &held.sprites,
                square_lists: &square_lists,
                lists: &lists,
            };
            passes.find(gpu, &mut pass, &buffers, blocks);
            let target = PictureTarget {
                viewports: frame.encoded_viewports,
                tiles: batch.tiles,
                pixels: &batch.pixels,
                partial_sums: frame.partial_sums,
                plane_pixels: batch.batch.pixels as u32,
            };
            let of_source: Vec<_> = [
                &parameters,
                &views,
                &held.map,
                &near,
                &held.sprites,
                &held.regions,
                &held.sprite_cells,
                &lists,
                &square_lists,
                &held.kernel_table,
            ]
            .into_iter()
            .enumerate()
            .map(|(binding, buffer)| (binding as u32, buffer.as_entire_binding()))
            .collect();
            composite.record(gpu, &mut pass, frame.fraction, &target, &of_source, batch.grid);
        }
    }
}
