//! Single asteroids in cells of a picture: position, size and illumination.

use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};

use crate::{
    catalogue::chunks::StarSet,
    chart::{ChartError, ViewShape, asteroids::SHAPE_SEED, workloads::rig_of},
    metrics::{ThreeSuns, sub_pixel_positions},
    plan::{
        asteroids::{
            classes::{Class, ClassRules},
            views::{DirectionTable, PictureBounds, eye_distance_m, impostor_reach},
        },
        settings::{AsteroidSettings, ImpostorMethod},
    },
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        asteroids::{AsteroidField, FieldParameters, Instances, Placement, Shape, ShapeSet, SpecError},
        bodies::{Body, Emission, ReflectionLaw, SolarBody, Spin, Surface},
    },
    view::{Rig, Viewport},
};

/// Distance of the asteroids from the first eye, m: near enough for a disparity of many pixels.
const DISTANCE_M: f64 = 2.0;
/// Mean radii of the first rows of cells, px, limited to the size of a cell.
const RADII_PX: [f64; 5] = [64.0, 16.0, 8.0, 4.0, 2.0];
/// Largest mean radius divided by the side of a cell.
const LARGEST_SHARE: f64 = 0.28;
/// Half side of the evaluated window divided by the side of its cell.
const WINDOW_SHARE: f64 = 0.49;
/// Cells along a side: one row per size and method of impostors.
const SIDE: usize = 8;
/// Half side of the square of cells divided by the radius of a round picture.
const ROUND_SHARE: f64 = 0.55;
/// Distance of the suns, m.
const SUN_M: f64 = 1.496e11;
/// Angle between the suns and the direction behind the camera, rad.
const SUN_OFF_RAD: f64 = 0.5;
/// Luminous body behind the silhouettes: distance of its centre, m, and radius divided by that distance.
const BEHIND_M: f64 = 1e8;
const BEHIND_SHARE: f64 = 0.985;

/// An asteroid in its own cell.
pub struct Cell {
    /// Row; all asteroids of a row have the same size.
    pub row: usize,
    /// Mean radius, px.
    pub radius_px: f64,
    /// Centre of the asteroid in every image, px.
    pub middles: Vec<DVec2>,
}

/// The scenes of a view: see the module documentation.
pub struct AsteroidScenes {
    pub rig: Rig,
    pub viewports: Vec<Viewport>,
    pub cells: Vec<Cell>,
    pub suns: ThreeSuns,
    /// Scene of asteroids without reflection in front of a luminous body.
    pub backlit: SceneSnapshot,
    /// Scene with only that body.
    pub empty: SceneSnapshot,
    /// Scenes of a Lambert surface under each of three suns.
    pub lit: [SceneSnapshot; 3],
    half_px: f64,
}

impl AsteroidScenes {
    /// Returns the scenes of a view; each of `methods` gets a row for the size of its impostors.
    ///
    /// # Errors
    /// [`ChartError`] if the view cannot be built.
    pub fn new(view: ViewShape, methods: &[AsteroidSettings]) -> Result<Self, ChartError> {
        // Geometry of the cells: a centred square of cells, smaller if the picture is round.
        let rig = rig_of(vec![("score", view.kind())])?;
        let viewports = rig.viewports(DQuat::IDENTITY);
        let shapes = Arc::new(ShapeSet::procedural(SHAPE_SEED));
        let first = &viewports[0];
        let [width, height] = first.size().map(f64::from);
        let share = if view.is_flat() { 1.0 } else { ROUND_SHARE };
        let cell_px = share * width.min(height) / SIDE as f64;
        let corner = 0.5 * (DVec2::new(width, height) - DVec2::splat(cell_px * SIDE as f64));
        let table = Arc::new(DirectionTable::new(&first.projection));
        // One row of cells per method of impostors, with the rules for its levels of detail.
        let mut impostors: Vec<&AsteroidSettings> = Vec::new();
        for settings in methods {
            let method = settings.impostor.chosen();
            if method != ImpostorMethod::None && !impostors.iter().any(|known| known.impostor.chosen() == method) {
                impostors.push(settings);
            }
        }
        let rules: Vec<ClassRules> = impostors
            .iter()
            .map(|settings| ClassRules {
                quality: settings.quality,
                impostor: impostor_reach(settings, eye_distance_m(&viewports, first)),
                finest_only: false,
            })
            .collect();
        let bounds = PictureBounds::new(first, 0.0, Arc::clone(&table), None);
        // Place one asteroid per cell, at a different sub-pixel position each.
        let (mut cells, mut fields) = (Vec::new(), Vec::new());
        let offsets: Vec<DVec2> = sub_pixel_positions(SIDE * SIDE).collect();
        for row in 0..RADII_PX.len() + rules.len() {
            for column in 0..SIDE {
                let number = row * SIDE + column;
                let middle = corner + cell_px * DVec2::new(column as f64 + 0.5, (row % SIDE) as f64 + 0.5);
                let pixel = middle.floor() + offsets[number % offsets.len()];
                let Some(direction) = first.projection.mapping().direction_from_pixel(pixel) else { continue };
                let pixel_rad = table.pixel_rad_at(bounds.place_of(direction, 1.0));
                let parameters = |radius_m: f64| FieldParameters {
                    instances: 1,
                    seed: number as u64 + 1,
                    placement: Placement::Box { size_m: DVec3::splat(1e-9) },
                    radius_m: [radius_m; 2],
                    size_index: 2.5,
                    spin_period_s: [3600.0, 7200.0],
                };
                let place = |radius_m: f64| {
                    Instances::place(&parameters(radius_m), shapes.shapes.len(), &shapes.bounds())
                        .map_err(|error| ChartError::Field(SpecError::Parameter(error)))
                };
                // The seed alone determines the shape.
                let shape = &shapes.shapes[place(1.0)?.packed[0].shape()];
                let radius_px = match RADII_PX.get(row) {
                    Some(radius_px) => *radius_px,
                    None => taken_over_px(&rules[row - RADII_PX.len()], shape, pixel_rad),
                };
                let radius_px = radius_px.min(LARGEST_SHARE * cell_px);
                // Position in the world, and centre in every image; cells outside of an image are left out.
                let world = first.eye_offset_m + first.world_from_view * direction * DISTANCE_M;
                let middle_in = |viewport: &Viewport| {
                    let direction = viewport.world_from_view.conjugate() * (world - viewport.eye_offset_m);
                    viewport.projection.mapping().pixel_from_direction(direction.normalize())
                };
                let Some(middles) = viewports.iter().map(middle_in).collect::<Option<Vec<_>>>() else { continue };
                fields.push(AsteroidField {
                    name: format!("asteroid-{number}"),
                    position_m: world,
                    orientation: DQuat::IDENTITY,
                    law: ReflectionLaw::Lambert,
                    geometric_albedo: [0.0; 3],
                    instances: Arc::new(place(radius_px * pixel_rad * DISTANCE_M)?),
                    shapes: Arc::clone(&shapes),
                });
                cells.push(Cell { row, radius_px, middles });
            }
        }
        // The same asteroids without reflection and with it, the luminous body, and three suns around the view direction.
        let dark: Vec<Arc<AsteroidField>> = fields.iter().cloned().map(Arc::new).collect();
        let bright: Vec<Arc<AsteroidField>> =
            fields.into_iter().map(|field| Arc::new(AsteroidField { geometric_albedo: [0.3; 3], ..field })).collect();
        let behind = Arc::new(shining());
        let directions = [0.0, 1.0, 2.0].map(|third: f64| {
            let (sin, cos) = (third * std::f64::consts::TAU / 3.0 + 0.3).sin_cos();
            DVec3::new(SUN_OFF_RAD.sin() * cos, SUN_OFF_RAD.sin() * sin, SUN_OFF_RAD.cos())
        });
        let suns = ThreeSuns::new(directions).map_err(|error| ChartError::Csv(error.to_string()))?;
        Ok(Self {
            backlit: scene(vec![Arc::clone(&behind)], dark),
            empty: scene(vec![behind], Vec::new()),
            lit: directions.map(|to_sun| {
                scene(vec![Arc::new(Body::preset(SolarBody::Sun, "sun", to_sun * SUN_M))], bright.clone())
            }),
            suns,
            cells,
            half_px: WINDOW_SHARE * cell_px,
            rig,
            viewports,
        })
    }

    /// Returns the mean radius of every row, px.
    pub fn rows(&self) -> Vec<f64> {
        let rows = self.cells.iter().map(|cell| cell.row + 1).max().unwrap_or(0);
        let of_row = |row: usize| {
            let radii: Vec<f64> = self.cells.iter().filter(|cell| cell.row == row).map(|cell| cell.radius_px).collect();
            radii.iter().sum::<f64>() / radii.len().max(1) as f64
        };
        (0..rows).map(of_row).collect()
    }

    /// Returns the indices of the pixels of a cell in an image.
    pub fn window(&self, cell: &Cell, image: usize) -> Vec<usize> {
        let [width, height] = self.viewports[image].size();
        let middle = cell.middles[image];
        let range = |middle: f64, size: u32| {
            (middle - self.half_px).floor().max(0.0) as usize
                ..((middle + self.half_px).ceil().max(0.0) as usize).min(size as usize)
        };
        let columns = range(middle.x, width);
        range(middle.y, height).flat_map(|y| columns.clone().map(move |x| y * width as usize + x)).collect()
    }

    /// Returns the solid angle of a pixel given by its index, sr.
    pub fn solid_angle_sr(&self, image: usize, pixel: usize) -> f64 {
        let width = self.viewports[image].size()[0] as usize;
        self.viewports[image].projection.mapping().solid_angle_sr((pixel % width) as u32, (pixel / width) as u32)
    }
}

fn scene(bodies: Vec<Arc<Body>>, fields: Vec<Arc<AsteroidField>>) -> SceneSnapshot {
    SceneSnapshot {
        revision: 1,
        stars: Arc::new(StarSet::from_records(Vec::new())),
        objects: Arc::new(SceneObjects { bodies, fields, time_s: 0.0, ..Default::default() }),
        camera: Camera::default(),
    }
}

/// Returns a uniformly luminous sphere that fills nearly half of the sky ahead.
fn shining() -> Body {
    Body {
        name: "behind".to_owned(),
        ephemeris: None,
        position_m: DVec3::NEG_Z * BEHIND_M,
        radii_m: DVec3::splat(BEHIND_SHARE * BEHIND_M),
        orientation: DQuat::IDENTITY,
        spin: Spin::default(),
        surface: Surface { law: ReflectionLaw::Lambert, geometric_albedo: [0.0; 3], phase_curve: None, texture: None },
        emission: Some(Emission { luminance_cd_m2: [1e4; 3], limb_darkening: 0.0, corona: false }),
        seen_through: [1.0; 3],
    }
}

/// Returns the largest mean radius, px, at which no part of an asteroid is drawn as a mesh.
fn taken_over_px(rules: &ClassRules, shape: &Shape, pixel_rad: f64) -> f64 {
    let meshes = |radius_px: f64| {
        let errors = shape.lods.iter().map(|lod| lod.error);
        let radius_m = radius_px * pixel_rad * DISTANCE_M;
        let classes = rules.classes(errors, shape.bound, radius_m, DISTANCE_M, pixel_rad);
        [Some(classes.class), classes.before].into_iter().flatten().any(|class| matches!(class, Class::Mesh(_)))
    };
    let [mut small, mut large] = [0.1, 1000.0];
    for _ in 0..60 {
        let middle = f64::sqrt(small * large);
        if meshes(middle) { large = middle } else { small = middle }
    }
    small
}
