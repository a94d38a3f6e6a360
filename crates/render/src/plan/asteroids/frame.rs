//! Plan of a frame's asteroids: which groups are searched for which picture, which cube faces lie behind pictures,
//! how long the lists may be, and how finely pictures are sampled.

use std::sync::Arc;

use glam::DVec3;

use super::kinds::{MAX_FIELDS, MAX_SHAPES};
use super::{
    bounds::direction_error_bound_rad,
    classes::ClassRules,
    cpu_cull::{self, PictureLists, WHOLE_PICTURE},
    cut::{self, AsteroidCut},
    kinds::{Kinds, MAX_SET_MESHES, Plane, planes_of},
    settings::{AsteroidSettings, Culling, ImpostorMethod},
    views::{DirectionTable, PictureBounds, eye_distance_m, impostor_reach},
};
use crate::{
    plan::{Approximation, Limits, PlanError},
    scene::{
        SceneObjects,
        asteroids::{AsteroidField, PackedAsteroid, Shape},
        bodies::Sun,
    },
    view::{
        Part, Viewport,
        projection::{Face, Projection},
    },
};

/// Distance at which the depth is 1, m. Nearer surfaces are not drawn. Depth is relative, so a small distance costs no accuracy.
pub const NEAR_M: f64 = 1e-3;

/// Maximum memory of the faces of a cube.
const FACE_BYTES: u64 = 1 << 30;
/// Bytes of a texel of colour and depth.
const TEXEL_BYTES: u64 = 12;
/// Value that p E / pi of the brightest group gets in the units of the targets. The range of f16 ends at 65504, and a mesh may be several times as
/// bright as this value.
const BRIGHTEST_UNITS: f64 = 1024.0;

/// Bytes of an entry of the lists on the adapter.
pub const ENTRY_BYTES: u64 = 12;

/// Link of a group to a plane: the asteroids of the group are counted and listed for that plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// Index of the plane.
    pub plane: usize,
    /// Index of the group among those of the plane.
    pub column: u32,
    /// Bit set of the faces that may show the group.
    pub faces: u8,
}

/// Condition for drawing a splatted impostor from a single tile: each of its errors is below half a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splats {
    /// Factor on the distances of detail.
    pub quality: f64,
    /// Greatest error of the direction of the nearest tile, rad.
    pub tile_error_rad: f64,
}

impl Splats {
    /// The condition for these settings; `None`: impostors are not splatted.
    fn new(settings: &AsteroidSettings) -> Option<Self> {
        if settings.finest_only || settings.impostor.chosen() != ImpostorMethod::OctahedralSplat {
            return None;
        }
        let tile_error_rad = direction_error_bound_rad(ImpostorMethod::Octahedral, settings.tiles)?;
        Some(Self { quality: settings.quality, tile_error_rad })
    }
}

/// Position of a plane's counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaneCounts {
    /// First count.
    pub first: u64,
    /// Number of groups linked to the plane.
    pub columns: u32,
}

/// See the module.
#[derive(Clone, Debug)]
pub struct AsteroidPlan {
    /// Groups to search, and points of light that represent whole groups.
    pub cut: AsteroidCut,
    /// Pictures.
    pub viewports: Vec<Viewport>,
    /// Bounds of each picture for culling.
    pub pictures: Vec<PictureBounds>,
    /// Rules for classes of detail, per viewport.
    pub rules: Vec<ClassRules>,
    /// For each viewport, the viewport whose classes apply: for a pair of eyes with equal pixels, that of the first eye.
    pub class_views: Vec<u32>,
    /// Planes to draw onto.
    pub planes: Vec<Plane>,
    /// Positions of the counts, one per plane.
    pub plane_counts: Vec<PlaneCounts>,
    /// Links of all groups.
    pub links: Vec<Link>,
    /// First link and number of links, per group.
    pub item_links: Vec<[u32; 2]>,
    /// Index of each kind of list.
    pub numbers: Kinds,
    /// Number of lists per plane, including the count of visible asteroids.
    pub kinds: u32,
    /// Maximum number of entries of the lists.
    pub capacity: u64,
    /// Number of counts of all planes, lists and groups.
    pub counts: u64,
    /// Samples along each side of a pixel, per viewport.
    pub samples: Vec<u32>,
    /// Texels along a side of the faces, per viewport.
    pub face_px: Vec<u32>,
    /// cd/m^2 per unit of the targets.
    pub luminance_scale: f64,
    /// Parameters of splatted impostors; `None`: they are drawn as squares, or there are none.
    pub splats: Option<Splats>,
    /// The lists, if the CPU has made them.
    pub lists: Option<Vec<PictureLists>>,
    /// Number of asteroids of all fields.
    pub asteroids: u64,
    /// Approximations.
    pub certificate: Vec<Approximation>,
}

/// Tables of pixel sizes and bends, by projection. They take long to compute and are kept from plan to plan.
#[derive(Clone, Debug, Default)]
pub struct Tables(Vec<(Projection, Arc<DirectionTable>)>);

impl Tables {
    /// The table of a projection, computed at the first call.
    pub fn for_projection(&mut self, projection: &Projection) -> Arc<DirectionTable> {
        if let Some((_, table)) = self.0.iter().find(|(known, _)| known == projection) {
            return table.clone();
        }
        let table = Arc::new(DirectionTable::new(projection));
        self.0.push((projection.clone(), table.clone()));
        table
    }

    /// Removes the tables that none of these viewports needs.
    fn keep(&mut self, viewports: &[Viewport]) {
        self.0.retain(|(projection, _)| viewports.iter().any(|viewport| viewport.projection == *projection));
    }
}

/// Checks that the fields of a scene can be drawn: that there are not too many fields, and that every shape has meshes.
pub fn check(objects: &SceneObjects, limits: &Limits) -> Result<(), PlanError> {
    let asteroids = objects.fields.iter().map(|field| field.instances.packed.len() as u64).sum();
    if objects.fields.len() > MAX_FIELDS {
        return Err(PlanError::TooManyFields { fields: objects.fields.len(), limit: MAX_FIELDS });
    }
    let shapes: usize = objects.fields.iter().map(|field| field.shapes.shapes.len()).sum();
    if shapes > MAX_SHAPES {
        return Err(PlanError::TooManyShapes { shapes, limit: MAX_SHAPES });
    }
    let bytes = limits.max_binding_bytes;
    let limit = (bytes / size_of::<PackedAsteroid>() as u64).min(u64::from(u32::MAX));
    if asteroids > limit {
        return Err(PlanError::TooManyAsteroids { asteroids, limit, bytes });
    }
    for field in &objects.fields {
        let shapes = &field.shapes.shapes;
        let meshes = shapes.iter().map(|shape| shape.lods.len()).sum();
        let drawable =
            |shape: &Shape| !shape.lods.is_empty() && shape.lods.iter().all(|lod| !lod.mesh.triangles.is_empty());
        if shapes.is_empty() || !shapes.iter().all(drawable) {
            return Err(PlanError::NoShape { field: field.name.clone() });
        }
        if meshes > MAX_SET_MESHES {
            return Err(PlanError::TooManyMeshes { field: field.name.clone(), meshes, limit: MAX_SET_MESHES });
        }
    }
    Ok(())
}

/// Inputs of a plan of asteroids.
#[derive(Clone, Copy)]
pub struct AsteroidInputs<'a> {
    /// The fields.
    pub objects: &'a SceneObjects,
    /// Settings.
    pub settings: &'a AsteroidSettings,
    /// The pictures.
    pub viewports: &'a [Viewport],
    /// Distance beyond the border of a picture up to which points reach into it, pixels.
    pub margin_px: f64,
    /// The camera (ICRS, barycentric, m).
    pub camera_m: DVec3,
    /// Suns that light them.
    pub suns: &'a [Sun],
    /// Limits of the adapter.
    pub limits: &'a Limits,
}

impl AsteroidPlan {
    /// Plans the fields of a scene. [`check`] must have accepted them. Returns `None` if there are no fields or no pictures.
    ///
    /// # Errors
    ///
    /// Fails if the lists exceed the adapter's binding size.
    pub fn new(inputs: &AsteroidInputs<'_>, tables: &mut Tables) -> Result<Option<Self>, PlanError> {
        let AsteroidInputs { objects, settings, viewports, margin_px, camera_m, suns, limits } = *inputs;
        if objects.fields.is_empty() || viewports.is_empty() {
            return Ok(None);
        }
        // Bounds of the pictures, and rules for classes of detail.
        let fields: Vec<&AsteroidField> = objects.fields.iter().map(Arc::as_ref).collect();
        let numbers = Kinds::new(fields.iter().copied());
        tables.keep(viewports);
        let pictures: Vec<PictureBounds> = viewports
            .iter()
            .map(|viewport| {
                let eyes_m = eye_distance_m(viewports, viewport);
                let reach = impostor_reach(settings, eyes_m);
                PictureBounds::new(viewport, margin_px, tables.for_projection(&viewport.projection), reach)
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
        // Groups that may be visible in pictures, and the complete lists if the CPU culls.
        let mut lists = None;
        let cut = if settings.culling == Culling::Cpu {
            let mut cut = cut::every_group(&fields, camera_m, &pictures, &rules, suns);
            let found = cpu_cull::cull(&fields, &numbers, camera_m, &pictures, &rules);
            for (faces, found) in cut.faces.iter_mut().zip(&found) {
                let used = (0..WHOLE_PICTURE).filter(|face| found.lists[*face].iter().any(|list| !list.is_empty()));
                *faces = used.fold(0, |bits, face| bits | 1 << face);
            }
            lists = Some(found);
            cut
        } else {
            cut::cut(&fields, camera_m, &pictures, &rules, suns)
        };
        let mut plan = Self {
            viewports: viewports.to_vec(),
            class_views: (0..viewports.len() as u32).map(|index| class_view(viewports, index)).collect(),
            planes: planes_of(&cut.faces),
            plane_counts: Vec::new(),
            links: Vec::new(),
            item_links: Vec::new(),
            kinds: numbers.lists() as u32 + 1,
            capacity: 0,
            counts: 0,
            samples: Vec::new(),
            face_px: Vec::new(),
            luminance_scale: luminance_scale(&fields, cut.brightest_lx),
            asteroids: fields.iter().map(|field| field.instances.packed.len() as u64).sum(),
            certificate: Vec::new(),
            splats: Splats::new(settings),
            pictures,
            rules,
            numbers,
            lists,
            cut,
        };
        // Positions of the lists, and sampling; both are limited by the adapter.
        plan.link(settings);
        plan.choose_samples(limits, settings);
        let limit = (limits.max_binding_bytes / ENTRY_BYTES).min(u64::from(u32::MAX));
        if plan.capacity > limit {
            return Err(PlanError::AsteroidLists { needed: plan.capacity, limit });
        }
        let limit = (limits.max_binding_bytes / 4).min(u64::from(u32::MAX));
        if plan.counts > limit {
            return Err(PlanError::AsteroidLists { needed: plan.counts, limit });
        }
        Ok(Some(plan))
    }

    /// Whether a mesh or an impostor may be drawn in a viewport.
    pub fn draws(&self, viewport: usize) -> bool {
        match &self.lists {
            Some(lists) => lists[viewport].lists.iter().flatten().any(|list| !list.is_empty()),
            None => self.plane_counts[viewport].columns > 0,
        }
    }

    /// Links groups to planes, and assigns the positions of counts and entries.
    fn link(&mut self, settings: &AsteroidSettings) {
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
                        self.links.push(Link { plane, column: columns[plane], faces });
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
            self.item_links.push([first_link, link_count]);
        }
        self.capacity = by_lists.unwrap_or(self.capacity);
        let mut first_count = 0_u64;
        for columns in columns {
            self.plane_counts.push(PlaneCounts { first: first_count, columns });
            first_count += u64::from(columns) * u64::from(self.kinds);
        }
        self.counts = first_count;
    }

    fn choose_samples(&mut self, limits: &Limits, settings: &AsteroidSettings) {
        let limit = limits.max_view_side_px;
        let (mut fewest, mut coarsest) = (settings.samples, 1.0_f64);
        for (index, (viewport, picture)) in self.viewports.iter().zip(&self.pictures).enumerate() {
            let [width, height] = viewport.size();
            let samples = settings.samples.clamp(1, (limit / width.max(height)).max(1));
            fewest = fewest.min(samples);
            self.samples.push(samples);
            let layers = u64::from(8 - self.cut.faces[index].leading_zeros());
            // At the centre of a face a texel covers 2 / side rad.
            let wanted = (2.0 * f64::from(samples) / picture.table.needed_rad).ceil();
            let fitting = ((FACE_BYTES / TEXEL_BYTES / layers.max(1)) as f64).sqrt().floor().min(f64::from(limit));
            let side = wanted.min(fitting).max(1.0);
            if layers > 0 {
                coarsest = coarsest.max(wanted / side);
            }
            self.face_px.push(side as u32);
        }
        let mut state = |name: &str, bound: f64, limit: Option<f64>| {
            self.certificate.push(Approximation::new(name, bound, "px", limit));
        };
        let half_px = 0.5 / settings.quality;
        state("omitted detail of an asteroid", half_px, None);
        state("straight edges of asteroids in pictures that are not flat", half_px, None);
        state("edges of asteroids, sampled", 0.5 / f64::from(fewest.max(1)), Some(0.5 / f64::from(settings.samples)));
        if self.cut.faces.iter().any(|faces| *faces != 0) {
            state("texels of the faces behind pictures, in samples", coarsest, Some(1.0));
        }
    }

    /// Index of the plane of a face of a viewport.
    pub fn plane_of(&self, viewport: usize, face: Option<Face>) -> Option<usize> {
        self.planes.iter().position(|plane| *plane == Plane { viewport, face })
    }
}

/// cd/m^2 per unit of the targets. It is a power of two, so it remains constant if the light hardly changes.
fn luminance_scale(fields: &[&AsteroidField], brightest_lx: f64) -> f64 {
    let albedo = fields.iter().flat_map(|field| field.geometric_albedo).fold(0.0, f64::max);
    let brightest = albedo * brightest_lx / std::f64::consts::PI;
    if brightest > 0.0 { 2.0_f64.powf((brightest / BRIGHTEST_UNITS).log2().ceil()) } else { 1.0 }
}

/// Index of the viewport whose classes apply to viewport `index`: for a pair of eyes with equal pixels, that of the first eye, otherwise `index`
/// itself.
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
