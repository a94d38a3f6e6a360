//! Workloads: skies and their views, for a quick and for a full run.
//!
//! All views look at the galactic anticentre, where stars are less dense than in the bulge and denser than at the
//! poles.

use std::{f64::consts::PI, path::PathBuf, sync::Arc, time::Duration};

use glam::{DMat3, DQuat, DVec3};

use super::{ChartError, asteroids::AsteroidExtent, live::LiveExtent, scores::ScoringSize};
use crate::{
    catalogue::{
        StarRecord,
        bright::bright_stars,
        chunks::StarSet,
        galaxy::{GalaxyParameters, generate},
    },
    coordinates::direction_from_lon_lat,
    scene::{Camera, SceneSnapshot},
    view::{
        Fov, Rig, RigError, View, ViewKind,
        projection::{Face, FisheyeMapping, Projection},
    },
};

/// ICRS right ascension of the galactic anticentre, degrees.
const ANTICENTRE_RA_DEG: f64 = 86.4;
/// ICRS declination of the galactic anticentre, degrees.
const ANTICENTRE_DEC_DEG: f64 = 28.9;
/// Vertical field of view of the flat views, rad.
pub const FLAT_FOV_Y_RAD: f64 = PI / 3.0;
/// Half of the field of view of an eye, rad.
pub(super) const EYE_HALF_FOV_RAD: f64 = std::f64::consts::FRAC_PI_4;
/// Distance between the eyes, m.
const IPD_M: f64 = 0.063;
/// Seed of the synthetic galaxies.
pub(super) const SEED: u64 = 1;

/// The stars of a workload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sky {
    /// `builtin:bright`, real stars.
    Bright,
    /// The synthetic galaxy with its given number of brightest stars.
    Galaxy(usize),
}

impl Sky {
    /// Returns the weight of the sky's workloads when time is divided among skies. Time grows with the number of stars, but less than in proportion.
    pub(super) fn weight(self) -> f64 {
        match self {
            Self::Bright => 1.0,
            Self::Galaxy(stars) => (stars as f64 / 1000.0).powf(0.4).max(1.0),
        }
    }

    /// Returns the name in workloads.
    pub fn name(self) -> String {
        match self {
            Self::Bright => "bright".to_owned(),
            Self::Galaxy(stars) if stars >= 1_000_000 && stars.is_multiple_of(1_000_000) => {
                format!("{}M", stars / 1_000_000)
            }
            Self::Galaxy(stars) if stars >= 1000 && stars.is_multiple_of(1000) => format!("{}k", stars / 1000),
            Self::Galaxy(stars) => stars.to_string(),
        }
    }
}

/// The skies of a run; skies that later axes need are cached.
#[derive(Default)]
pub(super) struct Skies {
    kept: Vec<(Sky, Arc<Vec<StarRecord>>)>,
}

/// Number of stars above which skies are recomputed instead of cached.
const MOST_KEPT: usize = 1_000_000;

impl Skies {
    /// Returns the stars of a sky.
    pub fn records(&mut self, sky: Sky) -> Result<Arc<Vec<StarRecord>>, ChartError> {
        if let Some((_, records)) = self.kept.iter().find(|(kept, _)| *kept == sky) {
            return Ok(records.clone());
        }
        let records = Arc::new(match sky {
            Sky::Bright => bright_stars(0.0),
            Sky::Galaxy(stars) => {
                generate(&GalaxyParameters { stars, seed: SEED, fainter_than: None, unresolved_light: false })?.stars
            }
        });
        if records.len() <= MOST_KEPT {
            self.kept.push((sky, records.clone()));
        }
        Ok(records)
    }
}

/// The view of a workload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViewShape {
    /// Flat, 60 degrees high.
    Flat([u32; 2]),
    /// Equidistant fisheye of 180 degrees.
    Dome(u32),
    /// The whole sky, equirectangular.
    FullSky([u32; 2]),
    /// Two eyes with this many pixels each, 90 degrees horizontally and vertically.
    Stereo([u32; 2]),
    /// The six faces of a cube.
    Cubemap(u32),
}

impl ViewShape {
    /// Returns the name in workloads.
    pub fn name(self) -> String {
        match self {
            Self::Flat([_, height]) => format!("anticentre-{height}p"),
            Self::Dome(size) => format!("dome-{size}"),
            Self::FullSky([width, _]) => format!("full-sky-{width}"),
            Self::Stereo([width, _]) => format!("stereo-{width}"),
            Self::Cubemap(face) => format!("cubemap-{face}"),
        }
    }

    /// Returns width and height of the (first) image, pixels.
    pub fn size(self) -> [u32; 2] {
        match self {
            Self::Flat(size) | Self::FullSky(size) | Self::Stereo(size) => size,
            Self::Dome(size) | Self::Cubemap(size) => [size; 2],
        }
    }

    /// Returns the same projection, scaled so that its longer side has `px` pixels.
    pub(super) fn with_longer_side(self, px: u32) -> Self {
        match self {
            Self::Flat(_) => Self::Flat([px; 2]),
            Self::Dome(_) => Self::Dome(px),
            Self::FullSky(_) => Self::FullSky([px, px / 2]),
            Self::Stereo(_) => Self::Stereo([px; 2]),
            Self::Cubemap(_) => Self::Cubemap(px),
        }
    }

    /// Whether every image is a flat plane.
    pub fn is_flat(self) -> bool {
        matches!(self, Self::Flat(_) | Self::Stereo(_) | Self::Cubemap(_))
    }

    pub(super) fn kind(self) -> ViewKind {
        match self {
            Self::Flat(size) => ViewKind::Perspective { size, fov_y_rad: FLAT_FOV_Y_RAD },
            Self::Dome(size) => {
                ViewKind::Fisheye { size: [size; 2], mapping: FisheyeMapping::Equidistant, fov_rad: PI }
            }
            Self::FullSky(size) => ViewKind::Equirectangular { size },
            Self::Stereo(size) => {
                let half = EYE_HALF_FOV_RAD;
                let eye = Fov { left_rad: -half, right_rad: half, up_rad: half, down_rad: -half };
                ViewKind::Stereo { size, ipd_m: IPD_M, fov_left: eye, fov_right: eye.mirrored() }
            }
            Self::Cubemap(face) => cubemap(face),
        }
    }
}

/// Size of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Extent {
    /// Skies, each with its views.
    pub skies: Vec<(Sky, Vec<ViewShape>)>,
    /// Typical exposures of users, EV at ISO 100. The views of the largest sky with at most a million stars are timed at these exposures too.
    pub exposures: Vec<f64>,
    /// Maximum number of measured frames per method and workload.
    pub rounds: usize,
    /// Time of the whole run, including all axes and the generation of skies. Work that is in progress at its end is still finished. Every method
    /// draws at least one frame in every workload, a fast method at least three.
    pub budget: Duration,
    /// Size of the scoring scenes.
    pub scoring: ScoringSize,
    /// Numbers of stars on the axis `scale`.
    pub scale: Vec<usize>,
    /// Numbers of stars of the deep stores that the axis `scale` makes.
    pub deep: Vec<usize>,
    /// Folders of further deep stores for the axis `scale`.
    pub stores: Vec<PathBuf>,
    /// Number of stars on the axis `views`.
    pub many_views_stars: usize,
    /// Raster of the axis `projectors`.
    pub projector: [u32; 2],
    /// Size of the axis `glare`.
    pub glare: GlareExtent,
    /// Size of the axis `asteroids`.
    pub asteroids: AsteroidExtent,
    /// Size of the axis `live`.
    pub live: LiveExtent,
}

/// Size of the axis `glare`.
#[derive(Clone, Debug, PartialEq)]
pub struct GlareExtent {
    /// Number of stars of the timed galaxy.
    pub stars: usize,
    /// The timed views, each with a smaller view of the same projection in which glare is compared with the reference.
    pub views: Vec<(ViewShape, ViewShape)>,
    /// Number of stars of the galaxy in which glare is compared.
    pub scored_stars: usize,
    /// Number of compared pixels per view.
    pub pixels: usize,
    /// Maximum number of measured frames per method and view.
    pub rounds: usize,
    /// Maximum time; the share of the whole run may be less.
    pub budget: Duration,
}

impl GlareExtent {
    fn new(stars: usize, [scored_stars, pixels]: [usize; 2], rounds: usize, budget: Duration) -> Self {
        let flat = ViewShape::Flat([480, 270]);
        Self {
            stars,
            views: vec![
                (ViewShape::Flat([1920, 1080]), flat),
                (ViewShape::Flat([3840, 2160]), flat),
                (ViewShape::Stereo([1440, 1600]), ViewShape::Stereo([180, 200])),
                (ViewShape::Cubemap(512), ViewShape::Cubemap(96)),
                (ViewShape::Dome(1024), ViewShape::Dome(256)),
                (ViewShape::FullSky([2048, 1024]), ViewShape::FullSky([256, 128])),
            ],
            scored_stars,
            pixels,
            rounds,
            budget,
        }
    }
}

impl Extent {
    /// Returns the size of a run of all axes except `live` that ends within four minutes on two cores without a GPU. On such a machine, blending
    /// methods need seconds for one frame of the whole sky with a million stars, so only the full run draws it.
    pub fn quick() -> Self {
        let (flat, dome) = (ViewShape::Flat([1920, 1080]), ViewShape::Dome(1024));
        Self {
            skies: vec![
                (Sky::Galaxy(10_000), vec![flat, dome, ViewShape::FullSky([2048, 1024])]),
                (Sky::Galaxy(1_000_000), vec![flat, dome]),
            ],
            exposures: vec![-5.4],
            rounds: 5,
            budget: Duration::from_secs(140),
            scoring: ScoringSize::default(),
            scale: vec![10_000, 100_000, 1_000_000],
            deep: vec![100_000],
            stores: Vec::new(),
            many_views_stars: 30_000,
            projector: [960, 540],
            glare: GlareExtent::new(100_000, [1000, 500], 3, Duration::from_secs(40)),
            asteroids: AsteroidExtent::quick(),
            live: LiveExtent::quick(),
        }
    }

    /// Returns the size of a full run, which takes about 55 minutes on two cores without a GPU. It has more stars on a GPU with dedicated memory.
    pub fn full(discrete_gpu: bool) -> Self {
        let all = vec![
            ViewShape::Flat([1280, 720]),
            ViewShape::Flat([1920, 1080]),
            ViewShape::Flat([3840, 2160]),
            ViewShape::Dome(2048),
            ViewShape::FullSky([2048, 1024]),
        ];
        // Views that take half a minute with every blending method on such a machine.
        let some = vec![all[1], all[2], all[4]];
        let mut skies = vec![
            (Sky::Bright, vec![all[1], all[3]]),
            (Sky::Galaxy(10_000), all.clone()),
            (Sky::Galaxy(100_000), all.clone()),
            (Sky::Galaxy(1_000_000), all.clone()),
            (Sky::Galaxy(10_000_000), if discrete_gpu { all.clone() } else { some }),
        ];
        let mut scale = vec![10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000];
        if discrete_gpu {
            skies.push((Sky::Galaxy(50_000_000), all));
            scale.push(50_000_000);
        }
        Self {
            skies,
            exposures: vec![-13.0, -8.5, -5.4],
            rounds: 11,
            budget: Duration::from_secs(2300),
            scoring: ScoringSize::default(),
            scale,
            deep: vec![100_000, 1_000_000, 10_000_000],
            stores: Vec::new(),
            many_views_stars: 1_000_000,
            projector: [1920, 1080],
            glare: GlareExtent::new(1_000_000, [3000, 2000], 11, Duration::from_secs(300)),
            asteroids: AsteroidExtent::full(discrete_gpu),
            live: LiveExtent::full(),
        }
    }

    /// Returns the number of workloads of the axis `stars`.
    pub fn workloads(&self) -> usize {
        let exposed = self.exposed_sky().map_or(0, |index| self.skies[index].1.len() * self.exposures.len());
        self.skies.iter().map(|(_, views)| views.len()).sum::<usize>() + exposed
    }

    /// Returns the index of the sky that is drawn at the exposures of users.
    pub(super) fn exposed_sky(&self) -> Option<usize> {
        let stars = |sky: Sky| if let Sky::Galaxy(stars) = sky { stars } else { 0 };
        let few = self.skies.iter().enumerate().filter(|(_, (sky, _))| stars(*sky) <= MOST_KEPT);
        few.max_by_key(|(_, (sky, _))| stars(*sky)).map(|(index, _)| index)
    }
}

/// Returns a camera at the Sun that looks at the galactic anticentre.
pub fn camera() -> Camera {
    let back = -direction_from_lon_lat(ANTICENTRE_RA_DEG.to_radians(), ANTICENTRE_DEC_DEG.to_radians());
    let right = DVec3::Z.cross(back).normalize();
    let world_from_camera = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back));
    Camera { world_from_camera, ..Camera::default() }
}

/// Returns a scene of these stars, seen by [`camera`].
pub fn snapshot(records: Vec<StarRecord>) -> SceneSnapshot {
    SceneSnapshot {
        revision: 1,
        stars: Arc::new(StarSet::from_records(records)),
        objects: Default::default(),
        camera: camera(),
    }
}

/// Returns a rig of named views, all at the camera's position and along its axes.
pub fn rig_of(views: Vec<(&str, ViewKind)>) -> Result<Rig, RigError> {
    Rig::new(
        views
            .into_iter()
            .map(|(name, kind)| View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO))
            .collect::<Result<_, _>>()?,
    )
}

/// Returns a view of all faces of a cube.
pub fn cubemap(face_size: u32) -> ViewKind {
    ViewKind::Cubemap { face_size, faces: Face::ALL.to_vec() }
}

/// Returns the projection of the only image of a rig's only view.
pub fn projection_of(rig: &Rig) -> &Projection {
    &rig.views()[0].images[0].projection
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinates::icrs_from_galactic;

    #[test]
    fn the_camera_looks_at_the_anticentre() {
        let forward = camera().world_from_camera * DVec3::NEG_Z;
        let anticentre = icrs_from_galactic() * DVec3::NEG_X;
        assert!(forward.angle_between(anticentre).to_degrees() < 0.05);
        let up = camera().world_from_camera * DVec3::Y;
        assert!(up.z > 0.8);
    }

    #[test]
    fn small_skies_are_cached() {
        let mut skies = Skies::default();
        let [first, again] = [(), ()].map(|()| skies.records(Sky::Bright).unwrap());
        assert!(Arc::ptr_eq(&first, &again) && first.len() > 200);
    }

    #[test]
    fn workload_names_are_distinct() {
        let names = |extent: &Extent| {
            let mut names: Vec<String> = extent
                .skies
                .iter()
                .flat_map(|(sky, views)| views.iter().map(move |view| format!("{} {}", sky.name(), view.name())))
                .collect();
            let exposed = extent.exposed_sky().unwrap();
            let all = names.len() + extent.skies[exposed].1.len() * extent.exposures.len();
            names.sort();
            names.dedup();
            assert!(names.len() <= all && all == extent.workloads());
            assert_eq!(extent.skies[exposed].0, Sky::Galaxy(1_000_000));
            names
        };
        assert!(names(&Extent::quick()).contains(&"1M anticentre-1080p".to_owned()));
        let full = names(&Extent::full(false));
        for name in ["bright dome-2048", "10M anticentre-2160p", "100k full-sky-2048", "10k anticentre-720p"] {
            assert!(full.contains(&name.to_owned()), "{name}: {full:?}");
        }
        assert!(names(&Extent::full(true)).contains(&"50M dome-2048".to_owned()));
        assert_eq!(Sky::Galaxy(1234).name(), "1234");
    }
}
