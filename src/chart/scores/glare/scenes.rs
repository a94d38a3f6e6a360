//! Scenes of glare with their expected values: a starry sky, and single stars off the axis, outside of the picture and
//! near the edges of a cube. The truth is `reference::glare`, which evaluates every source for every compared pixel.

use std::{f64::consts::PI, sync::Arc};

use glam::{DVec2, DVec3};

use crate::{
    catalogue::{StarRecord, chunks::StarSet},
    chart::{
        ChartError, ViewShape,
        workloads::{EYE_HALF_FOV_RAD, FLAT_FOV_Y_RAD, camera, rig_of},
    },
    photometry::{glare::GlareKernel, rec709::luminance},
    reference::{
        glare::sky_cube::{Veil, sampled_pixels},
        sky::{SkyStar, stars_for},
        stars::splat::Eye,
    },
    scene::{Camera, SceneSnapshot},
    units::SOLAR_TEMPERATURE_K,
    view::{
        Rig, ViewImage,
        projection::{PlaneMapping, pixel_centre},
    },
};

/// Stars down to this V magnitude are in the scenes. Pixels next to stars are not compared; with all visible stars few
/// pixels would remain.
const FAINTEST_V: f64 = 3.55;
/// Off-axis angles of the sources whose glare must be round, rad.
const OFF_AXIS_RAD: [f64; 2] = [PI / 4.0, PI / 3.0];
/// Upper limit of these angles as a share of half of the field of view.
const OF_HALF_FIELD: f64 = 0.85;
/// Radius of the circles around these sources, in pixels at the centre: interpolation between pixels adds 0.5 % to the deviation.
const CIRCLE_PX: f64 = 12.0;
/// Range of the fit of the falloff: from the angle of this many pixels at the centre to this angle, or to 0.8 of the half field if that is less.
const SLOPE_FROM_PX: f64 = 8.0;
const SLOPE_TO_RAD: f64 = PI / 3.0;
/// Angular distance from the picture to the source outside of it, rad.
const OUTSIDE_RAD: f64 = 2.0 * PI / 180.0;
/// Direction of the single star: on the front face of a cube some pixels from the edge, or inside the picture of any
/// view.
const CENTRAL: DVec3 = DVec3::new(0.11, 0.07, -1.0);
const AT_EDGE: DVec3 = DVec3::new(0.8, 0.35, -1.0);
/// Pixels are left out if sources within this many pixels scatter more than this share of their light: near the peak of
/// a kernel the result depends on pixel sampling.
const BESIDE_PX: f64 = 2.0;
const BESIDE_SHARE: f64 = 0.02;

/// A pixel with its expected value.
pub struct Compared {
    pub image: usize,
    pub pixel: [u32; 2],
    pub expected_cd_m2: f64,
    pub omega_sr: f64,
}

/// A scene of one star.
pub struct Placed {
    /// Unit vector in camera axes.
    pub direction: DVec3,
    pub scene: SceneSnapshot,
}

/// The starry sky in which glare is compared.
pub struct ScoredSky<'a> {
    pub records: &'a [StarRecord],
    /// Number of pixels to compare per view.
    pub pixels: usize,
}

/// All scenes of one view.
pub struct GlareScenes {
    pub rig: Rig,
    view: ViewShape,
    kernel: Arc<dyn GlareKernel>,
    pub sky: SceneSnapshot,
    pub places: Vec<Compared>,
    /// Number of sampled pixels before some were left out.
    pub sampled: usize,
    pub off_axis: Vec<Placed>,
    pub circle_rad: f64,
    pub central: Placed,
    pub slope_rad: [f64; 2],
    /// Light of `central` expected in the pictures, lx.
    pub flux_lx: f64,
    /// `None` if the view shows the whole sky.
    pub outside: Option<(SceneSnapshot, Vec<Compared>)>,
    /// Pixels of `central` on both sides of the edges of a cube; empty for other views.
    pub edges: Vec<[Compared; 2]>,
}

/// Returns a scene of a single star of magnitude 0, seen along the world axes.
fn one_star(towards: DVec3) -> Placed {
    let direction = towards.normalize();
    let (magnitude, temperature_k) = (0.0, SOLAR_TEMPERATURE_K);
    let record = StarRecord { position: direction, magnitude, temperature_k, distance_known: false };
    let stars = Arc::new(StarSet::from_records(vec![record]));
    Placed {
        direction,
        scene: SceneSnapshot { revision: 1, stars, objects: Default::default(), camera: Camera::default() },
    }
}

/// Returns half of the horizontal and vertical field of view, rad; `None` for a view of the whole sky.
fn half_field_rad(view: ViewShape) -> Option<[f64; 2]> {
    match view {
        ViewShape::Flat([width, height]) => {
            let tangent = (FLAT_FOV_Y_RAD / 2.0).tan() * f64::from(width) / f64::from(height);
            Some([tangent.atan(), FLAT_FOV_Y_RAD / 2.0])
        }
        ViewShape::Stereo(_) => Some([EYE_HALF_FOV_RAD; 2]),
        ViewShape::Dome(_) => Some([PI / 2.0; 2]),
        ViewShape::FullSky(_) | ViewShape::Cubemap(_) => None,
    }
}

/// Returns the compared images: the first of two eyes, all faces of a cube.
fn images(rig: &Rig, view: ViewShape) -> &[ViewImage] {
    let images = &rig.views()[0].images;
    if matches!(view, ViewShape::Stereo(_)) { &images[..1] } else { images }
}

/// Returns the stars in the coordinates of an image.
pub fn sources(scene: &SceneSnapshot, image: &ViewImage) -> Vec<SkyStar> {
    let world_from_view = scene.camera.world_from_camera * image.camera_from_view;
    stars_for(&scene.stars, Eye { world_from_view, ..Eye::default() }, 0.0)
}

impl GlareScenes {
    /// # Errors
    /// [`ChartError`] if the view cannot be built.
    pub fn new(view: ViewShape, sky: &ScoredSky<'_>, kernel: Arc<dyn GlareKernel>) -> Result<Self, ChartError> {
        let rig = rig_of(vec![("score", view.kind())])?;
        let images = images(&rig, view);
        let pixel_rad = images[0].projection.middle_pixel_rad();
        let field = half_field_rad(view);
        let [across, up] = field.unwrap_or([PI; 2]);
        let mut off_axis: Vec<f64> = OFF_AXIS_RAD.map(|angle| angle.min(OF_HALF_FIELD * across)).to_vec();
        off_axis.dedup();
        // Sources lie to the right; on a map of the whole sky they lie above, because glare on its equator is round
        // anyway.
        let towards = if matches!(view, ViewShape::FullSky(_)) { DVec3::Y } else { DVec3::X };
        let off_axis = off_axis.into_iter().map(|angle| one_star(towards * angle.sin() - DVec3::Z * angle.cos()));
        let central = one_star(if matches!(view, ViewShape::Cubemap(_)) { AT_EDGE } else { CENTRAL });
        let bright = |star: &&StarRecord| star.apparent_magnitude() < FAINTEST_V;
        let sources = sky.records.iter().filter(bright).copied().collect();
        let stars = Arc::new(StarSet::from_records(sources));
        let starry = SceneSnapshot { revision: 1, stars, objects: Default::default(), camera: camera() };
        let outside =
            field.map(|_| one_star(DVec3::Y * (up + OUTSIDE_RAD).sin() - DVec3::Z * (up + OUTSIDE_RAD).cos()));
        let mut found = Self {
            off_axis: off_axis.collect(),
            circle_rad: CIRCLE_PX * pixel_rad,
            slope_rad: [SLOPE_FROM_PX * pixel_rad, SLOPE_TO_RAD.min(0.8 * up)],
            sky: starry,
            places: Vec::new(),
            sampled: 0,
            central,
            flux_lx: 0.0,
            outside: None,
            edges: Vec::new(),
            view,
            kernel,
            rig,
        };
        let sampled = found.sampled(&found.sky, sky.pixels);
        found.sampled = sampled.len();
        found.places = found.without_neighbours_of_sources(sampled);
        found.outside = outside.map(|star| {
            let places = found.sampled(&star.scene, sky.pixels);
            (star.scene, places)
        });
        found.flux_lx = found.flux_lx();
        if matches!(view, ViewShape::Cubemap(_)) {
            found.edges = found.edges();
        }
        Ok(found)
    }

    pub fn images(&self) -> &[ViewImage] {
        images(&self.rig, self.view)
    }

    /// Returns the luminance of the veil of `central` at an angle, cd/m^2.
    pub fn per_sr(&self, angle_rad: f64) -> f64 {
        let light: f64 = sources(&self.central.scene, &self.images()[0]).iter().map(|s| luminance(s.rgb_lx)).sum();
        light * self.kernel.per_sr(angle_rad)
    }

    fn compared(&self, scene: &SceneSnapshot, image: usize, pixels: &[[u32; 2]]) -> Vec<Compared> {
        let view_image = &self.images()[image];
        let mapping = view_image.projection.mapping();
        let sources = sources(scene, view_image);
        let veil = Veil { sources: &sources, kernel: &*self.kernel, fraction: 1.0 };
        let places = pixels.iter().zip(veil.over_pixels(mapping, pixels));
        places
            .filter_map(|(&pixel, expected)| {
                let omega_sr = mapping.solid_angle_sr(pixel[0], pixel[1]);
                Some(Compared { image, pixel, expected_cd_m2: luminance(expected?), omega_sr })
            })
            .collect()
    }

    /// Returns pixels spread over all images.
    fn sampled(&self, scene: &SceneSnapshot, pixels: usize) -> Vec<Compared> {
        let each = pixels.div_ceil(self.images().len());
        let of_image = |(index, image): (usize, &ViewImage)| {
            self.compared(scene, index, &sampled_pixels(image.projection.mapping(), each, &[]))
        };
        self.images().iter().enumerate().flat_map(of_image).collect()
    }

    /// Keeps the pixels that are not dominated by a source next to them.
    fn without_neighbours_of_sources(&self, places: Vec<Compared>) -> Vec<Compared> {
        let all: Vec<Vec<SkyStar>> = self.images().iter().map(|image| sources(&self.sky, image)).collect();
        let is_fair = |place: &Compared| {
            let projection = &self.images()[place.image].projection;
            let [x, y] = place.pixel;
            let Some(centre) = projection.mapping().direction_from_pixel(pixel_centre(x, y)) else { return false };
            let chord = BESIDE_PX * projection.middle_pixel_rad();
            let beside = all[place.image].iter().filter(|star| star.direction.distance(centre) < chord);
            let beside: Vec<SkyStar> = beside.copied().collect();
            let veil = Veil { sources: &beside, kernel: &*self.kernel, fraction: 1.0 };
            let light = veil.over_pixel(projection.mapping(), place.pixel).map_or(0.0, luminance);
            light <= BESIDE_SHARE * place.expected_cd_m2
        };
        places.into_iter().filter(is_fair).collect()
    }

    fn flux_lx(&self) -> f64 {
        let of_image = |(index, image): (usize, &ViewImage)| {
            let [width, height] = image.projection.mapping().size();
            let pixels: Vec<[u32; 2]> = (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).collect();
            let places = self.compared(&self.central.scene, index, &pixels);
            places.iter().map(|place| place.expected_cd_m2 * place.omega_sr).sum::<f64>()
        };
        self.images().iter().enumerate().map(of_image).sum()
    }

    /// Returns the pixels along the borders of all faces, each with its neighbour across the edge.
    fn edges(&self) -> Vec<[Compared; 2]> {
        let images = self.images();
        let mut pairs = Vec::new();
        for (here, image) in images.iter().enumerate() {
            let mapping = image.projection.mapping();
            let [width, height] = mapping.size();
            // The point lies as far outside the face's plane as the pixel's neighbour lies inside.
            let across = |[x, y]: [u32; 2], outwards: [f64; 2]| {
                let on_plane = |position: DVec2| mapping.direction_from_pixel(position).map(|on| on / -on.z);
                let centre = pixel_centre(x, y);
                let beyond = 2.0 * on_plane(centre)? - on_plane(centre - DVec2::from(outwards))?;
                let (there, pixel) = face_with(images, here, image.camera_from_view * beyond)?;
                let [first] = <[Compared; 1]>::try_from(self.compared(&self.central.scene, here, &[[x, y]])).ok()?;
                let [second] = <[Compared; 1]>::try_from(self.compared(&self.central.scene, there, &[pixel])).ok()?;
                Some([first, second])
            };
            for i in 0..width.min(height) {
                let border = [
                    ([0, i], [-1.0, 0.0]),
                    ([width - 1, i], [1.0, 0.0]),
                    ([i, 0], [0.0, -1.0]),
                    ([i, height - 1], [0.0, 1.0]),
                ];
                pairs.extend(border.into_iter().filter_map(|(pixel, outwards)| across(pixel, outwards)));
            }
        }
        pairs
    }
}

/// Returns the face, other than `except`, that shows a direction in camera axes, and the pixel.
fn face_with(images: &[ViewImage], except: usize, direction: DVec3) -> Option<(usize, [u32; 2])> {
    images.iter().enumerate().filter(|(index, _)| *index != except).find_map(|(index, image)| {
        let mapping: &dyn PlaneMapping = image.projection.mapping();
        let position = mapping.pixel_from_direction(image.camera_from_view.conjugate() * direction)?;
        let [width, height] = mapping.size().map(f64::from);
        let inside = (0.0..width).contains(&position.x) && (0.0..height).contains(&position.y);
        inside.then_some((index, [position.x as u32, position.y as u32]))
    })
}
