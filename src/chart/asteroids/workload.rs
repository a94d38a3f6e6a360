//! Workloads of the axis `asteroids`: a box of asteroids with constant volume and a growing number, seen from just
//! outside.
//!
//! The near face of the box is as wide as the flat view, so that the whole box is on screen. It extends from [`NEAR_M`]
//! to four times that distance. Radii are spread so that the largest near asteroids show the finest level of detail and
//! the smallest far ones are points: all levels occur. The sun shines from the side.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use crate::{
    catalogue::chunks::StarSet,
    chart::{ChartError, Sky},
    plan::settings::{
        AsteroidSettings, Culling, ExposureSettings, GlareSettings, ImpostorMethod, MethodSource, RenderSettings,
    },
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        asteroids::{FieldParameters, FieldSpec, MadeField, Placement, ShapeSource},
        bodies::{Body, ReflectionLaw, SolarBody},
    },
};

/// Distance of the box from the camera, m.
const NEAR_M: f64 = 10_000.0;
/// Sides of the box, m.
const SIZE_M: DVec3 = DVec3::new(20_000.0, 11_000.0, 30_000.0);
/// Smallest and largest mean radius, m.
const RADIUS_M: [f64; 2] = [16.0, 1000.0];
/// Position of the camera at the Earth's distance from the Sun, m.
const CAMERA_M: DVec3 = DVec3::new(1.496e11, 0.0, 0.0);
const SEED: u64 = 7;
/// Seed of the shapes.
pub const SHAPE_SEED: u64 = 3;

/// Position and direction of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Outside of the field, with the whole field on screen.
    Before,
    /// Same position, facing away: no view sees the field.
    TurnedAway,
    /// In the middle of the field.
    Within,
}

/// A method of drawing asteroids.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Name in the chart.
    pub name: &'static str,
    /// Origin of the method.
    pub source: MethodSource,
    /// Settings of asteroids.
    pub settings: AsteroidSettings,
    /// Note on every row of the variant.
    pub note: &'static str,
}

impl Variant {
    /// Returns all charted variants.
    pub fn all() -> Vec<Self> {
        let published = MethodSource::AsteroidFieldRendering;
        let ours = MethodSource::Steradian;
        let variant = |name, source, impostor, culling, note| {
            let settings = AsteroidSettings { impostor, culling, ..AsteroidSettings::default() };
            Self { name, source, settings, note }
        };
        vec![
            variant(
                "mesh_only",
                published,
                ImpostorMethod::None,
                Culling::Gpu,
                "meshes down to points, culled on the GPU",
            ),
            variant(
                "cpu_culling",
                published,
                ImpostorMethod::EulerAtlas,
                Culling::Cpu,
                "meshes and the impostors of euler_atlas, every asteroid tested on one CPU core",
            ),
            variant(
                "gpu_culling_euler_atlas",
                published,
                ImpostorMethod::EulerAtlas,
                Culling::Gpu,
                "impostors start at the distance where their error is half a pixel, not at a fixed distance as published",
            ),
            variant("gpu_culling_octahedral", ours, ImpostorMethod::Octahedral, Culling::Gpu, ""),
            variant("gpu_culling_octahedral_blend", ours, ImpostorMethod::OctahedralBlend, Culling::Gpu, ""),
            variant("gpu_culling_octahedral_splat", ours, ImpostorMethod::OctahedralSplat, Culling::Gpu, ""),
        ]
    }

    /// Returns the settings of a frame with this variant.
    pub fn render_settings(&self) -> RenderSettings {
        let mut settings = RenderSettings { asteroids: self.settings.clone(), ..RenderSettings::default() };
        settings.glare = GlareSettings::none();
        // Daylight exposure, as used for asteroids in sunlight.
        settings.exposure = ExposureSettings::manual(12.0);
        settings
    }
}

/// The fields of a run. Unchanged parts are reused from scene to scene.
#[derive(Default)]
pub struct Fields {
    last: Option<MadeField>,
}

impl Fields {
    /// Returns the scene with this number of asteroids.
    ///
    /// # Errors
    /// [`ChartError::Field`] if the number is out of range.
    pub fn scene(&mut self, instances: u32, place: Place) -> Result<SceneSnapshot, ChartError> {
        let spec = FieldSpec {
            name: "field".to_owned(),
            position_m: CAMERA_M - DVec3::Z * (NEAR_M + 0.5 * SIZE_M.z),
            orientation: DQuat::IDENTITY,
            parameters: FieldParameters {
                instances,
                seed: SEED,
                placement: Placement::Box { size_m: SIZE_M },
                radius_m: RADIUS_M,
                size_index: 2.5,
                spin_period_s: [600.0, 36_000.0],
            },
            shapes: ShapeSource::Procedural { seed: SHAPE_SEED },
            law: ReflectionLaw::LommelSeeliger,
            geometric_albedo: [0.1; 3],
        };
        let made = Arc::new(spec).make(self.last.as_slice())?;
        let field = Arc::clone(&made.field);
        self.last = Some(made);
        let camera = match place {
            Place::Before => Camera { position_m: CAMERA_M, ..Camera::default() },
            Place::TurnedAway => Camera {
                position_m: CAMERA_M,
                world_from_camera: DQuat::from_rotation_y(std::f64::consts::PI),
                ..Camera::default()
            },
            Place::Within => Camera { position_m: field.position_m, ..Camera::default() },
        };
        let sun = Arc::new(Body::preset(SolarBody::Sun, "sun", DVec3::ZERO));
        Ok(SceneSnapshot {
            revision: 1,
            stars: Arc::new(StarSet::from_records(Vec::new())),
            objects: Arc::new(SceneObjects {
                bodies: vec![sun],
                fields: vec![field],
                time_s: 0.0,
                ..Default::default()
            }),
            camera,
        })
    }
}

/// Formats a number of asteroids for the name of a workload.
pub fn count_name(instances: u32) -> String {
    match instances {
        many if many >= 1_000_000 && many.is_multiple_of(10_000) => format!("{}M", f64::from(many) / 1e6),
        few => Sky::Galaxy(few as usize).name(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_abbreviated() {
        let names = [2000, 250_000, 1_000_000, 1_250_000, 32_000_000].map(count_name);
        assert_eq!(names, ["2k", "250k", "1M", "1.25M", "32M"]);
    }

    #[test]
    fn volume_is_constant_and_field_is_in_front_of_camera() {
        let mut fields = Fields::default();
        let half_height = (0.5 * crate::chart::workloads::FLAT_FOV_Y_RAD).tan();
        for count in [500, 2000] {
            let scene = fields.scene(count, Place::Before).unwrap();
            let field = &scene.objects.fields[0];
            assert_eq!(field.instances.packed.len(), count as usize);
            for index in 0..count as usize {
                let from_camera = field.position_m + field.instances.place_m(index).unwrap() - scene.camera.position_m;
                let depth = -from_camera.z;
                assert!((NEAR_M * 0.999..=4.001 * NEAR_M).contains(&depth), "{depth}");
                assert!(
                    from_camera.y.abs() <= half_height * depth && from_camera.x.abs() <= 1.78 * half_height * depth
                );
            }
        }
        assert!(fields.scene(0, Place::Before).is_err());
    }
}
