//! The plan of a frame's asteroids, in the form that shaders read.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::held::Held;
use crate::{
    frame::RenderError,
    gpu::{
        Gpu,
        constants::{
            asteroid_classes::{VIEW_FLAT, VIEW_LONGITUDE, VIEW_ROUND},
            asteroid_instances::{ITEM_HOLDS_POINTS, ITEM_HOLDS_SHAPES},
            reflection::{LAW_LAMBERT, LAW_LOMMEL_SEELIGER},
        },
        encode_viewport, layout,
    },
    plan::{
        Approximation, KernelPlan,
        asteroids::{
            classes::ClassRules,
            cpu_cull::{self, PictureLists, WHOLE_PICTURE},
            cut::{self, AsteroidCut, GroupItem},
            kinds::{Plane, planes_of},
            views::{DirectionTable, PictureBounds, PictureKind, eye_distance_m, impostor_reach},
        },
        settings::{AsteroidSettings, Culling},
    },
    scene::{
        SceneObjects,
        asteroids::AsteroidField,
        bodies::{ReflectionLaw, Sun},
    },
    view::{
        Part, Viewport,
        projection::{Face, Perspective, Projection},
    },
};

/// Distance of depth 1, m: what is nearer is not drawn. Depth is relative, so it costs no accuracy.
pub(super) const NEAR_M: f64 = 1e-3;

/// Memory that the faces of a cube may take.
const FACE_BYTES: u64 = 1 << 30;
/// Bytes of a texel of colour and depth.
const TEXEL_BYTES: u64 = 12;
/// Value of the target at p E / pi of the brightest group: halves end at 65504, and a mesh may be several times as bright.
const BRIGHTEST_UNITS: f64 = 1024.0;

/// See the module.
pub(crate) struct AsteroidPlan {
    pub(crate) cut: AsteroidCut,
    pub(super) viewports: Vec<Viewport>,
    pub(super) planes: Vec<Plane>,
    pub(super) encoded_planes: Vec<layout::AsteroidPlane>,
    pub(super) items: Vec<layout::AsteroidItem>,
    pub(super) links: Vec<layout::AsteroidLink>,
    pub(super) views: Vec<layout::AsteroidView>,
    pub(super) tables: Vec<[f32; 2]>,
    pub(super) fields: Vec<layout::AsteroidField>,
    /// Lists per plane, the count of those seen included.
    pub(super) kinds: u32,
    /// Entries that the lists may have.
    pub(super) capacity: u64,
    /// Counts of all planes, lists and groups.
    pub(super) counts: u64,
    /// Samples along each side of a pixel, per viewport.
    pub(super) samples: Vec<u32>,
    /// Texels along a side of the faces, per viewport.
    pub(super) face_px: Vec<u32>,
    pub(super) luminance_scale: f64,
    /// The lists where the CPU has made them.
    pub(super) lists: Option<Vec<PictureLists>>,
    /// Asteroids of all fields.
    pub(super) asteroids: u64,
    /// What is approximated.
    pub(crate) certificate: Vec<Approximation>,
}

/// Directions' tables, kept from frame to frame.
pub(super) type Tables = Vec<(Projection, Arc<DirectionTable>)>;

pub(super) fn table_of(tables: &mut Tables, projection: &Projection) -> Arc<DirectionTable> {
    if let Some((_, table)) = tables.iter().find(|(known, _)| known == projection) {
        return table.clone();
    }
    let table = Arc::new(DirectionTable::new(projection));
    tables.push((projection.clone(), table.clone()));
    table
}

impl AsteroidPlan {
    #[expect(clippy::too_many_arguments, reason = "a plan takes the scene, the pictures and the settings")]
    pub(super) fn new(
        gpu: &Gpu,
        held: &Held,
        tables: &mut Tables,
        objects: &SceneObjects,
        settings: &AsteroidSettings,
        viewports: &[Viewport],
        margin_px: f64,
        camera_m: DVec3,
        suns: &[Sun],
    ) -> Result<Self, RenderError> {
        let fields: Vec<&AsteroidField> = objects.fields.iter().map(Arc::as_ref).collect();
        tables.retain(|(projection, _)| viewports.iter().any(|viewport| viewport.projection == *projection));
        let pictures: Vec<PictureBounds> = viewports
            .iter()
            .map(|viewport| {
                let eyes_m = eye_distance_m(viewports, viewport);
                let reach = impostor_reach(settings, eyes_m);
                PictureBounds::new(viewport, margin_px, table_of(tables, &viewport.projection), reach)
            })
            .collect();
        let rules: Vec<ClassRules> = pictures
            .iter()
            .map(|picture| ClassRules {
                quality: settings.quality,
                impostor: picture.impostor,
                finest_only: settings.finest_only,
            })
            .collect();
        let mut lists = None;
        let cut = if settings.culling == Culling::Cpu {
            let mut cut = cut::every_group(&fields, camera_m, &pictures, &rules, suns);
            let found = cpu_cull::cull(&fields, &held.kinds, camera_m, &pictures, &rules);
            for (faces, found) in cut.faces.iter_mut().zip(&found) {
                let used = (0..WHOLE_PICTURE).filter(|face| found.lists[*face].iter().any(|list| !list.is_empty()));
                *faces = used.fold(0, |bits, face| bits | 1 << face);
            }
            lists = Some(found);
            cut
        } else {
            cut::cut(&fields, camera_m, &pictures, &rules, suns)
        };
        let planes = planes_of(&cut.faces);
        let kinds = held.kinds.lists() as u32 + 1;
        let tables: Vec<[f32; 2]> = pictures
            .iter()
            .flat_map(|picture| picture.table.pixel_rad.iter().zip(&picture.table.bend))
            .map(|(pixel, bend)| [*pixel as f32, *bend as f32])
            .collect();
        let views = (0..)
            .zip(&pictures)
            .zip(&rules)
            .map(|((i, picture), rules)| encode_view(i, picture, rules, class_view(viewports, i)))
            .collect();
        let mut plan = Self {
            viewports: viewports.to_vec(),
            encoded_planes: Vec::new(),
            items: Vec::new(),
            links: Vec::new(),
            views,
            tables,
            fields: fields.iter().enumerate().map(|(i, field)| encode_field(held, objects, i, field)).collect(),
            kinds,
            capacity: 0,
            counts: 0,
            samples: Vec::new(),
            face_px: Vec::new(),
            luminance_scale: luminance_scale(&fields, cut.brightest_lx),
            asteroids: fields.iter().map(|field| field.instances.packed.len() as u64).sum(),
            certificate: Vec::new(),
            planes,
            lists,
            cut,
        };
        plan.link(held, settings);
        plan.choose_samples(gpu, settings, &pictures);
        let limit = (gpu.max_binding_bytes() / size_of::<layout::AsteroidEntry>() as u64).min(u64::from(u32::MAX));
        if plan.capacity > limit {
            return Err(RenderError::AsteroidLists { needed: plan.capacity, limit });
        }
        let limit = (gpu.max_binding_bytes() / 4).min(u64::from(u32::MAX));
        if plan.counts > limit {
            return Err(RenderError::AsteroidLists { needed: plan.counts, limit });
        }
        Ok(plan)
    }

    /// Whether anything may be drawn as a mesh or an impostor in a viewport.
    pub(crate) fn draws(&self, viewport: usize) -> bool {
        match &self.lists {
            Some(lists) => lists[viewport].lists.iter().flatten().any(|list| !list.is_empty()),
            None => self.encoded_planes[viewport].columns > 0,
        }
    }

    /// Links groups to planes, and numbers counts and entries.
    fn link(&mut self, held: &Held, settings: &AsteroidSettings) {
        let mut columns = vec![0_u32; self.planes.len()];
        let doubled = if settings.finest_only { 1 } else { 2 };
        let by_lists = self.lists.as_ref().map(|lists| {
            lists.iter().flat_map(|found| &found.lists).flatten().map(|list| list.len() as u64).sum::<u64>()
        });
        for (index, item) in self.cut.items.iter().enumerate() {
            let first_link = self.links.len() as u32;
            if index < self.cut.shape_items && by_lists.is_none() {
                let mut remaining = item.viewports;
                while remaining != 0 {
                    let viewport = remaining.trailing_zeros() as usize;
                    remaining &= remaining - 1;
                    let faces = item.faces.iter().find(|(of, _)| *of == viewport).map_or(0, |(_, faces)| *faces);
                    let mut link = |plane: usize, faces: u8| {
                        self.links.push(layout::AsteroidLink {
                            plane: plane as u32,
                            column: columns[plane],
                            faces: u32::from(faces),
                            unused_0: 0,
                        });
                        columns[plane] += 1;
                        let copies = if item.crosses_seam { 2 } else { 1 };
                        self.capacity += u64::from(item.count) * doubled * copies;
                    };
                    link(viewport, faces);
                    for (plane, of) in self.planes.iter().enumerate().skip(self.viewports.len()) {
                        if of.viewport == viewport && of.face.is_some_and(|face| faces >> face as u8 & 1 == 1) {
                            link(plane, faces);
                        }
                    }
                }
            }
            let link_count = self.links.len() as u32 - first_link;
            self.items.push(encode_item(held, item, first_link, link_count));
        }
        self.capacity = by_lists.unwrap_or(self.capacity);
        let mut first_count = 0_u64;
        for (plane, columns) in self.planes.iter().zip(columns) {
            self.encoded_planes.push(layout::AsteroidPlane {
                view: plane.viewport as u32,
                face: plane.face.map_or(WHOLE_PICTURE as u32, |face| face as u32),
                first_count: first_count as u32,
                columns,
            });
            first_count += u64::from(columns) * u64::from(self.kinds);
        }
        self.counts = first_count;
    }

    fn choose_samples(&mut self, gpu: &Gpu, settings: &AsteroidSettings, pictures: &[PictureBounds]) {
        let limit = gpu.max_view_side_px();
        let (mut fewest, mut coarsest) = (settings.samples, 1.0_f64);
        for (index, (viewport, picture)) in self.viewports.iter().zip(pictures).enumerate() {
            let [width, height] = viewport.size();
            let samples = settings.samples.clamp(1, (limit / width.max(height)).max(1));
            fewest = fewest.min(samples);
            self.samples.push(samples);
            let layers = u64::from(8 - self.cut.faces[index].leading_zeros());
            // In the middle of a face a texel covers 2 / side.
            let wanted = (2.0 * f64::from(samples) / picture.table.needed_rad).ceil();
            let fitting = ((FACE_BYTES / TEXEL_BYTES / layers.max(1)) as f64).sqrt().floor().min(f64::from(limit));
            let side = wanted.min(fitting).max(1.0);
            if layers > 0 {
                coarsest = coarsest.max(wanted / side);
            }
            self.face_px.push(side as u32);
        }
        let mut state = |what: &str, bound: f64, unit: &str, within: Option<bool>| {
            self.certificate.push(Approximation {
                what: what.to_owned(),
                bound,
                unit: unit.to_owned(),
                within_budget: within,
            });
        };
        let half_px = 0.5 / settings.quality;
        state("detail left out of an asteroid", half_px, "px", None);
        state("straight edges of asteroids in pictures that are not flat", half_px, "px", None);
        state("edges of asteroids, sampled", 0.5 / f64::from(fewest.max(1)), "px", Some(fewest == settings.samples));
        if self.cut.faces.iter().any(|faces| *faces != 0) {
            state("texels of the faces behind pictures, over a sample", coarsest, "px", Some(coarsest <= 1.0));
        }
    }

    /// The plane that a picture or a face is drawn on, as shaders read it.
    pub(super) fn encoded_viewport(&self, plane: &Plane) -> layout::Viewport {
        let viewport = &self.viewports[plane.viewport];
        match plane.face {
            None => encode_viewport(viewport, &KernelPlan::bspline()),
            Some(face) => {
                let side = self.face_px[plane.viewport];
                let behind = Viewport {
                    projection: Projection::Perspective(Perspective::from_tangents([side; 2], [-1.0, 1.0, -1.0, 1.0])),
                    world_from_view: viewport.world_from_view * face.cube_from_face(),
                    ..viewport.clone()
                };
                encode_viewport(&behind, &KernelPlan::bspline())
            }
        }
    }

    /// The plane of a face of a viewport.
    pub(super) fn plane_of(&self, viewport: usize, face: Option<Face>) -> Option<usize> {
        self.planes.iter().position(|plane| *plane == Plane { viewport, face })
    }
}

/// cd/m^2 per unit of the targets: a power of two, so that it stays while the light hardly changes.
fn luminance_scale(fields: &[&AsteroidField], brightest_lx: f64) -> f64 {
    let albedo = fields.iter().flat_map(|field| field.geometric_albedo).fold(0.0, f64::max);
    let brightest = albedo * brightest_lx / std::f64::consts::PI;
    if brightest > 0.0 { 2.0_f64.powf((brightest / BRIGHTEST_UNITS).log2().ceil()) } else { 1.0 }
}

fn encode_item(held: &Held, item: &GroupItem, first_link: u32, link_count: u32) -> layout::AsteroidItem {
    let origin = item.origin_m.as_vec3();
    let low = (item.origin_m - origin.as_dvec3()).as_vec3();
    layout::AsteroidItem {
        origin: origin.to_array(),
        first: held.kinds.first_instance[item.field] as u32 + item.first,
        origin_low: low.to_array(),
        count: item.count,
        sun: item.sun.as_vec3().to_array(),
        field: item.field as u32,
        illuminance: item.illuminance_lx.map(|lx| lx as f32),
        flags: u32::from(item.holds_points) * ITEM_HOLDS_POINTS | u32::from(item.holds_shapes) * ITEM_HOLDS_SHAPES,
        viewports: [item.viewports as u32, (item.viewports >> 32) as u32],
        first_link,
        link_count,
    }
}

fn encode_field(held: &Held, objects: &SceneObjects, index: usize, field: &AsteroidField) -> layout::AsteroidField {
    let rotation = DMat3::from_quat(field.orientation);
    let row = |i: usize, w: f64| rotation.row(i).extend(w).as_vec4().to_array();
    let set = held.kinds.set(index);
    layout::AsteroidField {
        world_from_field_x: row(0, field.instances.largest_m / 65535.0),
        world_from_field_y: row(1, 0.0),
        world_from_field_z: row(2, 0.0),
        albedo: field.geometric_albedo.map(|albedo| albedo as f32),
        law: match field.law {
            ReflectionLaw::Lambert => LAW_LAMBERT,
            ReflectionLaw::LommelSeeliger => LAW_LOMMEL_SEELIGER,
        },
        time_parts: field.instances.time_parts(objects.time_s),
        first_shape: set.first_shape as u32,
        shape_count: set.shapes.shapes.len() as u32,
        first_kind: set.first_kind as u32,
        kinds: set.meshes as u32,
        impostor_kind: held.kinds.impostor_kind(held.kinds.set_of_field[index]) as u32,
        ..Default::default()
    }
}

/// The viewport whose classes hold for viewport `index`: of a pair of eyes with pixels alike the first one's, else its own.
fn class_view(viewports: &[Viewport], index: u32) -> u32 {
    let own = &viewports[index as usize];
    let first = index.checked_sub(1).filter(|before| {
        let other = &viewports[*before as usize];
        own.part == Part::RightEye
            && other.part == Part::LeftEye
            && other.view == own.view
            && own.size() == other.size()
            && own.projection.middle_pixel_rad() <= 1.02 * other.projection.middle_pixel_rad()
            && other.projection.middle_pixel_rad() <= 1.02 * own.projection.middle_pixel_rad()
    });
    first.unwrap_or(index)
}

fn encode_view(index: u32, picture: &PictureBounds, rules: &ClassRules, class_view: u32) -> layout::AsteroidView {
    let row = |i: usize| picture.view_from_world.row(i).extend(picture.eye_m[i]).as_vec4().to_array();
    let [x, y] = match picture.planes.as_slice() {
        [left, right, down, up] => [[left.x, left.z, right.x, right.z], [down.y, down.z, up.y, up.z]],
        _ => [[0.0; 4]; 2],
    };
    layout::AsteroidView {
        view_from_world_x: row(0),
        view_from_world_y: row(1),
        view_from_world_z: row(2),
        edges_x: x.map(|value| value as f32),
        edges_y: y.map(|value| value as f32),
        cone_sine: picture.cone[0] as f32,
        cone_cosine: picture.cone[1] as f32,
        kind: match picture.kind {
            PictureKind::Flat => VIEW_FLAT,
            PictureKind::Round => VIEW_ROUND,
            PictureKind::Longitude => VIEW_LONGITUDE,
        },
        first_entry: index * picture.table.pixel_rad.len() as u32,
        impostor_eyes: picture.impostor.map_or(0.0, |impostor| impostor.eyes_m as f32),
        impostor_linear: picture.impostor.map_or(-1.0, |impostor| impostor.linear as f32),
        impostor_exponent: picture.impostor.map_or(0.0, |impostor| impostor.exponent as f32),
        quality: rules.quality as f32,
        finest_only: u32::from(rules.finest_only),
        class_view,
        ..Default::default()
    }
}
