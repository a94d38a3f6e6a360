//! Bodies and points of light on the adapter: what the geometry pass and the point pass read, and what they leave for the others.

use std::sync::{Arc, OnceLock};

use crate::{
    gpu::{
        Gpu, GrowingBuffer,
        constants::{
            bodies::NO_TEXTURE,
            reflection::{LAW_LAMBERT, LAW_LOMMEL_SEELIGER},
        },
        layout, storage_buffer,
    },
    passes::{
        geometry::{GeometryPass, GeometryTarget},
        points::PointPass,
        shared::{Occlusion, RasterLayers},
    },
    plan::{
        tiles::{BYTES_PER_PIXEL, Batch, Tile},
        view_bodies::{BodyDisc, BodyPlan, PointSource},
    },
    scene::{
        SceneObjects,
        bodies::{ReflectionLaw, Texture},
    },
};

/// Passes and buffers, made when they are first asked for.
pub(super) struct Geometry {
    pass: OnceLock<GeometryPass>,
    point_pass: OnceLock<PointPass>,
    /// What the pixels of each batch show.
    batches: Vec<GrowingBuffer>,
    textures: Option<Textures>,
    stand_in: wgpu::Buffer,
}

/// The textures of a scene's bodies, with all their levels, in one buffer.
struct Textures {
    held: Vec<Arc<Texture>>,
    /// First word of each.
    first: Vec<u32>,
    words: wgpu::Buffer,
}

/// The bodies of a frame as shaders read them.
pub(super) struct GeometryFrame {
    view_bodies: wgpu::Buffer,
    body_runs: wgpu::Buffer,
    suns: wgpu::Buffer,
    texels: wgpu::Buffer,
}

/// Words of a texture: three channels of 10 bits each, of the square root, all levels from the finest on.
pub(super) fn texture_words(texture: &Texture) -> Vec<u32> {
    let mut words = Vec::new();
    let [mut width, mut height] = texture.size.map(|side| side as usize);
    let mut level: Vec<[f32; 3]> = texture.rgb.clone();
    loop {
        words.extend(level.iter().map(|rgb| {
            let channel = |value: f32| (value.clamp(0.0, 1.0).sqrt() * 1023.0).round() as u32;
            channel(rgb[0]) | channel(rgb[1]) << 10 | channel(rgb[2]) << 20
        }));
        if width * height == 1 {
            return words;
        }
        let (half_width, half_height) = ((width / 2).max(1), (height / 2).max(1));
        // The last row and column of an odd side count with the one before.
        let mut coarser = Vec::with_capacity(half_width * half_height);
        for y in 0..half_height {
            let rows = y * height / half_height..(y + 1) * height / half_height;
            for x in 0..half_width {
                let columns = x * width / half_width..(x + 1) * width / half_width;
                let mut sum = [0.0; 3];
                for row in rows.clone() {
                    for column in columns.clone() {
                        let rgb = level[row * width + column];
                        sum = [sum[0] + rgb[0], sum[1] + rgb[1], sum[2] + rgb[2]];
                    }
                }
                let count = (rows.len() * columns.len()) as f32;
                coarser.push(sum.map(|channel| channel / count));
            }
        }
        (level, width, height) = (coarser, half_width, half_height);
    }
}

/// Bytes that the textures of a scene take on the adapter.
pub(super) fn texture_bytes(objects: &SceneObjects) -> u64 {
    let words = |texture: &Arc<Texture>| texture.size.map(u64::from).iter().product::<u64>() * 4 / 3 + 32;
    distinct_textures(objects).iter().map(|texture| 4 * words(texture)).sum()
}

fn distinct_textures(objects: &SceneObjects) -> Vec<Arc<Texture>> {
    let mut distinct: Vec<Arc<Texture>> = Vec::new();
    for texture in objects.bodies.iter().filter_map(|body| body.surface.texture.as_ref()) {
        if !distinct.iter().any(|other| Arc::ptr_eq(other, texture)) {
            distinct.push(Arc::clone(texture));
        }
    }
    distinct
}

impl Textures {
    fn new(gpu: &Gpu, held: Vec<Arc<Texture>>) -> Self {
        let mut words = Vec::new();
        let first = held
            .iter()
            .map(|texture| {
                let first = words.len() as u32;
                words.extend(texture_words(texture));
                first
            })
            .collect();
        Self { held, first, words: storage_buffer(gpu, "body textures", &words) }
    }

    fn first_of(&self, texture: &Arc<Texture>) -> u32 {
        let index = self.held.iter().position(|held| Arc::ptr_eq(held, texture));
        index.map_or(NO_TEXTURE, |index| self.first[index])
    }
}

impl Geometry {
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self {
            pass: OnceLock::new(),
            point_pass: OnceLock::new(),
            batches: Vec::new(),
            textures: None,
            stand_in: storage_buffer(gpu, "no geometry", &[[0_u32; 32]]),
        }
    }

    /// Lets go of buffers.
    pub(super) fn release(&mut self) {
        self.batches.clear();
        self.textures = None;
    }

    /// Uploads the bodies of a frame.
    pub(super) fn begin(
        &mut self,
        gpu: &Gpu,
        objects: &SceneObjects,
        plan: &BodyPlan,
        batches: &[Batch],
    ) -> GeometryFrame {
        let textures = distinct_textures(objects);
        let same = |held: &Textures| {
            held.held.len() == textures.len() && held.held.iter().zip(&textures).all(|(a, b)| Arc::ptr_eq(a, b))
        };
        let textures = match self.textures.take().filter(same) {
            Some(held) => held,
            None => Textures::new(gpu, textures),
        };
        self.batches.truncate(batches.len());
        while self.batches.len() < batches.len() {
            self.batches.push(GrowingBuffer::new("geometry", wgpu::BufferUsages::STORAGE));
        }
        for (buffer, batch) in self.batches.iter_mut().zip(batches) {
            buffer.with_room(gpu, batch.pixels * BYTES_PER_PIXEL);
        }
        let mut view_bodies: Vec<layout::ViewBody> = Vec::new();
        let mut suns: Vec<layout::BodySun> = Vec::new();
        let mut runs: Vec<[u32; 2]> = Vec::new();
        for seen in &plan.seen {
            runs.push([view_bodies.len() as u32, seen.len() as u32]);
            for body in seen {
                view_bodies.push(encode_body(objects, body, suns.len() as u32, &textures));
                suns.extend(body.suns.iter().map(|(direction, light)| layout::BodySun {
                    direction: direction.as_vec3().to_array(),
                    illuminance: light.map(|lx| lx as f32),
                    ..Default::default()
                }));
            }
        }
        let frame = GeometryFrame {
            view_bodies: self.filled(gpu, "view bodies", &view_bodies),
            body_runs: self.filled(gpu, "body runs", &runs),
            suns: self.filled(gpu, "body suns", &suns),
            texels: textures.words.clone(),
        };
        self.textures = Some(textures);
        frame
    }

    /// A buffer of a list; of nothing where it is empty.
    fn filled<T: bytemuck::NoUninit>(&self, gpu: &Gpu, label: &str, items: &[T]) -> wgpu::Buffer {
        if items.is_empty() { self.stand_in.clone() } else { storage_buffer(gpu, label, items) }
    }

    /// Records one tile, number `index` of batch `batch`.
    #[expect(clippy::too_many_arguments, reason = "a tile's place and its buffers")]
    pub(super) fn record_tile(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        frame: &GeometryFrame,
        (batch, index): (usize, u32),
        tile: &Tile,
        width: u32,
        layers: Option<&RasterLayers<'_>>,
        (viewports, tiles): (&wgpu::Buffer, &wgpu::Buffer),
    ) {
        let geometry = self.pass.get_or_init(|| GeometryPass::new(gpu));
        let target = GeometryTarget {
            viewports,
            tiles,
            geometry: self.of_batch(batch),
            view_bodies: &frame.view_bodies,
            body_runs: &frame.body_runs,
            suns: &frame.suns,
            texels: &frame.texels,
        };
        geometry.record(gpu, pass, index, tile, width, layers, &target);
    }

    fn of_batch(&self, batch: usize) -> &wgpu::Buffer {
        self.batches.get(batch).and_then(GrowingBuffer::held).unwrap_or(&self.stand_in)
    }

    /// What stands before the stars of a batch.
    pub(super) fn occlusion<'a>(&'a self, frame: Option<&'a GeometryFrame>, batch: usize) -> Occlusion<'a> {
        match frame {
            Some(frame) => Occlusion {
                present: true,
                geometry: self.of_batch(batch),
                view_bodies: &frame.view_bodies,
                body_runs: &frame.body_runs,
            },
            None => Occlusion {
                present: false,
                geometry: &self.stand_in,
                view_bodies: &self.stand_in,
                body_runs: &self.stand_in,
            },
        }
    }

    /// The pass of points.
    pub(super) fn point_pass(&self, gpu: &Gpu) -> &PointPass {
        self.point_pass.get_or_init(|| PointPass::new(gpu))
    }
}

fn encode_body(objects: &SceneObjects, seen: &BodyDisc, first_sun: u32, textures: &Textures) -> layout::ViewBody {
    let body = &objects.bodies[seen.body];
    let unit_from_view = seen.unit_from_view * seen.distance_m;
    let row = |index: usize| unit_from_view.row(index).as_vec3().to_array();
    let texture = body.surface.texture.as_ref();
    let emission = body.emission.as_ref();
    layout::ViewBody {
        unit_from_view_x: row(0),
        unit_from_view_y: row(1),
        unit_from_view_z: row(2),
        distance_m: seen.distance_m as f32,
        on_plane: u32::from(seen.on_plane),
        inverse_smallest: (1.0 / body.radii_m.min_element()) as f32,
        centre: seen.centre.as_vec3().to_array(),
        part: seen.part as f32,
        unit_centre: (unit_from_view * seen.centre).as_vec3().to_array(),
        law: match body.surface.law {
            ReflectionLaw::Lambert => LAW_LAMBERT,
            ReflectionLaw::LommelSeeliger => LAW_LOMMEL_SEELIGER,
        },
        reflectance: body.surface.geometric_albedo.map(|albedo| (seen.kept * albedo / std::f64::consts::PI) as f32),
        limb_darkening: emission.map_or(0.0, |emission| emission.limb_darkening as f32),
        emission: emission
            .map_or([0.0; 3], |emission| emission.luminance_cd_m2.map(|channel| (seen.kept * channel) as f32)),
        first_sun,
        sun_count: seen.suns.len() as u32,
        texture: texture.map_or(NO_TEXTURE, |texture| textures.first_of(texture)),
        texture_size: texture.map_or([0; 2], |texture| texture.size),
    }
}

/// The points that tiles of a batch may show, as shaders read them.
pub(super) fn encode_points(points: &[PointSource], tiles: &[Tile]) -> Vec<layout::Point> {
    points
        .iter()
        .filter_map(|point| {
            let seen_by = |tile: &Tile| point.viewports & 1 << tile.viewport != 0;
            let tiles: u32 =
                tiles.iter().enumerate().filter(|(_, tile)| seen_by(tile)).fold(0, |set, (i, _)| set | 1 << i);
            (tiles != 0).then(|| layout::Point {
                offset: point.offset_m.as_vec3().to_array(),
                tiles,
                intensity: point.intensity_cd.map(|cd| cd as f32),
                radius: point.radius_m as f32,
            })
        })
        .collect()
}
