//! Bodies as every viewport's eye sees them: which ones are drawn as a disc, nearest first, which as a point of light, and what each
//! gives to the eye.
//!
//! A body of less than [`POINT_BELOW_PX`] across is a point, one of more than [`DISC_FROM_PX`] a disc; in between its light is shared out,
//! so that a body that shrinks does not pop.

use std::{
    f64::consts::{FRAC_PI_2, PI},
    sync::{Arc, Weak},
};

use glam::{DMat3, DVec2, DVec3};

use super::{
    light::illuminance_of,
    meeting::{self, Round},
};
use crate::plan::{
    glare::objects::{Source, body_sources},
    stars::cull::MAX_VIEWPORTS,
};
use crate::{
    photometry::{
        corona,
        glare::GlareKernel,
        phase_curve::{Tilt, ring_share},
        rec709::luminance,
        rings,
    },
    scene::{
        SceneObjects,
        bodies::{Body, Light, SolarBody, Sun, lights_on},
    },
    view::{
        Viewport,
        projection::{FisheyeMapping, Projection, pixel_centre},
    },
};

/// Diameter below which a body is a point, pixels.
pub const POINT_BELOW_PX: f64 = 2.0;
/// Diameter from which on it is a disc, pixels.
pub const DISC_FROM_PX: f64 = 4.0;
/// A body whose direction is at least so far before the plane of a flat picture's eye is measured in tangents.
const LEAST_COSINE: f64 = 0.05;

/// A point of light that is no star.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSource {
    /// Place relative to the camera, world axes, m.
    pub offset_m: DVec3,
    /// Intensity, linear Rec. 709, cd.
    pub intensity_cd: [f64; 3],
    /// What stands nearer than its place by this is not before it, m.
    pub radius_m: f64,
    /// Bit i: viewport i may see it.
    pub viewports: u64,
}

/// A body that a viewport shows as a disc.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyDisc {
    /// Its number in the scene.
    pub body: usize,
    /// Direction of its middle, view axes: a tangent (z = -1) if `on_plane`, else a unit vector.
    pub centre: DVec3,
    /// See `centre`.
    pub on_plane: bool,
    /// How far the middle is, m over the length of `centre`.
    pub distance_m: f64,
    /// From view axes, m, to the body's axes, in semi-axes.
    pub unit_from_view: DMat3,
    /// Angle from its middle beyond which the middle of no pixel shows anything of it, rad.
    pub reach_rad: f64,
    /// Share of its light that the disc has.
    pub part: f64,
    /// Factor on its luminance: 1, but for light that it scatters onto itself.
    pub kept: f64,
    /// The suns that light it.
    pub suns: Vec<DiscSun>,
    /// What is around it.
    pub around: Around,
}

/// What is drawn around a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Around {
    /// Nothing, or dark rings.
    #[default]
    Nothing,
    /// Rings: their luminance over what they reflect ([`crate::photometry::rings`]), linear Rec. 709, cd/m^2.
    Rings([f64; 3]),
    /// A corona ([`crate::photometry::corona`]): mean luminance of the disc, linear Rec. 709, cd/m^2.
    Corona([f64; 3]),
}

impl Around {
    /// The luminance that it is told by.
    pub fn light_cd_m2(self) -> [f64; 3] {
        match self {
            Self::Nothing => [0.0; 3],
            Self::Rings(light) | Self::Corona(light) => light,
        }
    }
}

/// A sun in the sky of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscSun {
    /// Unit vector to it, view axes.
    pub direction: DVec3,
    /// Its light there, in the body's axes.
    pub in_body: Light,
}

/// The bodies of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyPlan {
    /// Those that each viewport shows as discs, nearest first.
    pub seen: Vec<Vec<BodyDisc>>,
    /// Those that are points, with the share of their light that the point has.
    pub points: Vec<PointSource>,
    /// What every body gives to each viewport's eye: number of the body and lx.
    pub lights: Vec<Vec<(usize, [f64; 3])>>,
    /// The same of those that reach into its picture.
    pub in_view: Vec<Vec<(usize, [f64; 3])>>,
    /// What scatters in each viewport's eye.
    pub glare: Vec<Vec<Source>>,
}

impl PointSource {
    /// What it gives to an eye at `eye_m` from the camera, lx; nothing at its very place.
    pub fn light_at_lx(&self, eye_m: DVec3) -> f64 {
        let squared = (self.offset_m - eye_m).length_squared();
        if squared > 0.0 { luminance(self.intensity_cd) / squared } else { 0.0 }
    }
}

impl BodyPlan {
    /// Takes into account what glare of a kernel, which scatters `fraction` of all light, leaves on the discs it comes from.
    pub fn keep_own_glare(&mut self, kernel: &dyn GlareKernel, fraction: f64) {
        for (seen, sources) in self.seen.iter_mut().zip(&self.glare) {
            for disc in seen {
                let own = sources.iter().find(|source| source.body == disc.body);
                disc.kept = own.map_or(1.0, |source| source.kept(kernel, fraction));
            }
        }
    }

    /// Light of the bodies that viewports show, over all of them, lx.
    pub fn light_in_view_lx(&self) -> f64 {
        let of_viewport = |lights: &Vec<(usize, [f64; 3])>| lights.iter().map(|(_, lx)| luminance(*lx)).sum::<f64>();
        self.in_view.iter().map(of_viewport).sum()
    }
}

/// Share of its light that a body of a diameter has as a disc.
fn disc_part(diameter_px: f64) -> f64 {
    let t = ((diameter_px - POINT_BELOW_PX) / (DISC_FROM_PX - POINT_BELOW_PX)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Longer angle across the pixel that shows a direction, rad; of the one next to it where that lies outside of the picture.
fn pixel_across_rad(viewport: &Viewport, direction: DVec3) -> f64 {
    let mapping = viewport.projection.mapping();
    let [width, height] = mapping.size();
    let across = mapping.pixel_from_direction(direction).and_then(|pixel| {
        let held = |at: f64, side: u32| (at.max(0.0) as u32).min(side - 1);
        let centre = pixel_centre(held(pixel.x, width), held(pixel.y, height));
        let half = |x: f64, y: f64| mapping.direction_from_pixel(centre + DVec2::new(x, y));
        let middle = mapping.direction_from_pixel(centre)?;
        let sides = [half(0.5, 0.0), half(-0.5, 0.0), half(0.0, 0.5), half(0.0, -0.5)];
        sides.into_iter().flatten().map(|side| 2.0 * side.angle_between(middle)).reduce(f64::max)
    });
    across.unwrap_or_else(|| viewport.projection.middle_pixel_rad())
}

/// What every body gives to an eye and scatters in it: it depends on neither where the eye looks nor on the picture.
#[derive(Clone, Debug)]
struct LightsAt {
    eye_m: DVec3,
    lights: Vec<(usize, [f64; 3])>,
    glare: Vec<Source>,
}

/// What bodies give to eyes, kept while the objects are the same: it takes longer than the rest of a plan.
#[derive(Clone, Debug, Default)]
pub struct HeldLights {
    of: Weak<SceneObjects>,
    eyes: Vec<LightsAt>,
}

impl HeldLights {
    fn at(&mut self, objects: &Arc<SceneObjects>, suns: &[Sun], eye_m: DVec3) -> &LightsAt {
        if !self.of.upgrade().is_some_and(|of| Arc::ptr_eq(&of, objects)) {
            *self = Self { of: Arc::downgrade(objects), eyes: Vec::new() };
        }
        let held = self.eyes.iter().position(|held| held.eye_m == eye_m);
        let index = held.unwrap_or_else(|| {
            if self.eyes.len() >= MAX_VIEWPORTS {
                // A camera that moves leaves its eyes behind.
                self.eyes.clear();
            }
            let light = |of: &Arc<Body>| illuminance_of(of, eye_m, suns, objects.time_s);
            let lights: Vec<(usize, [f64; 3])> = objects.bodies.iter().map(light).enumerate().collect();
            let glare = body_sources(objects, eye_m, &lights, suns);
            self.eyes.push(LightsAt { eye_m, lights, glare });
            self.eyes.len() - 1
        });
        &self.eyes[index]
    }
}

/// Plans the bodies, lit by `suns` (those of the scene), for a camera at `camera_m`, world axes; points reach `margin_px` over the border of a picture.
pub fn plan_bodies(
    objects: &Arc<SceneObjects>,
    suns: &[Sun],
    held: &mut HeldLights,
    camera_m: DVec3,
    viewports: &[Viewport],
    margin_px: f64,
) -> BodyPlan {
    let mut plan = BodyPlan::default();
    for (index, viewport) in viewports.iter().enumerate() {
        let eye_m = camera_m + viewport.eye_offset_m;
        let LightsAt { lights, glare, .. } = held.at(objects, suns, eye_m).clone();
        let mut candidates: Vec<Candidate<'_>> = Vec::new();
        let mut in_view_of: Vec<(usize, [f64; 3])> = Vec::new();
        let cone = viewport.projection.mapping().bounding_cone(margin_px);
        for (body, light) in objects.bodies.iter().zip(&lights) {
            let offset_m = body.position_m - eye_m;
            let distance_m = offset_m.length();
            let largest_m = body.radii_m.max_element();
            // From inside nothing of it is seen.
            let unit_from_world = unit_from_world(body, objects.time_s);
            if unit_from_world.mul_vec3(offset_m).length() <= 1.0 {
                continue;
            }
            // Through the air it is seen elsewhere, and pressed together.
            let radius_rad = (largest_m / distance_m).min(1.0).asin();
            let seen_from_place = match &objects.local_sky {
                Some(sky) => sky.seen_body(offset_m, radius_rad),
                None => DMat3::IDENTITY,
            };
            let seen_m = seen_from_place * offset_m;
            let in_view = viewport.world_from_view.conjugate().mul_vec3(seen_m);
            // Who stands within rings or a corona has them on all sides.
            let wide_rad = |radii: f64| {
                let wide_m = radii * largest_m;
                if wide_m < distance_m { (wide_m / distance_m).asin() } else { PI }
            };
            // A corona has next to none of the light.
            let lit_rad = wide_rad(if has_rings(body) { rings::OUTER } else { 1.0 });
            let has_corona = body.emission.is_some_and(|emission| emission.corona);
            let widest_rad = if has_corona { wide_rad(corona::OUTER) } else { lit_rad };
            // Between where the middle of the viewing circle sees it and where an eye on the circle does.
            let parallax_rad = (viewport.viewing_circle_m.abs() / distance_m).min(1.0).asin();
            let beside_rad = in_view.angle_between(cone.axis) - cone.half_angle_rad - parallax_rad;
            if beside_rad > widest_rad {
                continue;
            }
            if beside_rad <= lit_rad {
                in_view_of.push(*light);
            }
            candidates.push(Candidate {
                body,
                light: *light,
                seen: Round {
                    direction: in_view.normalize(),
                    distance_m,
                    radius_rad,
                    diameter_px: 2.0 * radius_rad / pixel_across_rad(viewport, in_view),
                },
                seen_m,
                reach_rad: widest_rad + parallax_rad + limb_rad(&viewport.projection),
                place: Seen { eye_m, seen_from_place, unit_from_world },
            });
        }
        let rounds: Vec<Round> = candidates.iter().map(|candidate| candidate.seen).collect();
        let alone: Vec<f64> = rounds.iter().map(|round| disc_part(round.diameter_px)).collect();
        let mut seen: Vec<BodyDisc> = Vec::new();
        for (candidate, parts) in candidates.iter().zip(meeting::drawn(&rounds, &alone)) {
            let Candidate { body, light, seen: Round { distance_m, .. }, seen_m, reach_rad, place } = candidate;
            if parts.disc < 1.0 {
                plan.points.push(PointSource {
                    offset_m: *seen_m + viewport.eye_offset_m,
                    intensity_cd: light.1.map(|lx| lx * parts.point * distance_m * distance_m),
                    radius_m: 1.01 * body.radii_m.max_element(),
                    viewports: 1 << index,
                });
            }
            if parts.disc > 0.0 {
                let disc = body_disc(*light, body, place, viewport, parts.disc, (suns, objects.time_s));
                seen.push(BodyDisc { reach_rad: *reach_rad, ..disc });
            }
        }
        seen.sort_by(|a, b| surface_m(objects, a).total_cmp(&surface_m(objects, b)));
        plan.seen.push(seen);
        plan.in_view.push(in_view_of);
        plan.glare.push(glare);
        plan.lights.push(lights);
    }
    plan
}

/// A body that may be seen in a picture.
struct Candidate<'a> {
    body: &'a Body,
    light: (usize, [f64; 3]),
    seen: Round,
    /// Where it is seen, relative to the eye, world axes.
    seen_m: DVec3,
    /// See [`BodyDisc::reach_rad`].
    reach_rad: f64,
    place: Seen,
}

/// How far the middles of pixels that show a limb may be from it, rad: the half of their diagonal by which shaders go, where the middle pixel is the largest one.
fn limb_rad(projection: &Projection) -> f64 {
    let middle_is_largest = match projection {
        Projection::Perspective(_) | Projection::CubeFace(_) | Projection::Equirectangular(_) => true,
        Projection::Fisheye(fisheye) => {
            matches!(fisheye.mapping, FisheyeMapping::Equidistant | FisheyeMapping::Stereographic)
        }
        Projection::Tabulated(_) => false,
    };
    // Beside round pictures, whose middles have no image, as far as anything is.
    if middle_is_largest { 1.5 * projection.middle_pixel_rad() } else { PI }
}

/// Whether a body has rings: Saturn with its measured light.
fn has_rings(body: &Body) -> bool {
    body.surface.phase_curve == Some(SolarBody::Saturn)
}

/// Divides the light of a body with rings, which is that of both together, between its globe, whose suns give less, and its rings: what these reflect of one unit, cd/m^2. `None`: they have none.
fn lit_rings(body: &Body, eye_m: DVec3, light_lx: [f64; 3], suns: &mut [Light]) -> Option<[f64; 3]> {
    let sun = suns.first().filter(|_| has_rings(body))?;
    let to_eye_m = eye_m - body.position_m;
    let pole = body.orientation * DVec3::Z;
    let latitude_rad = |towards: DVec3| FRAC_PI_2 - pole.angle_between(towards);
    let tilt = Tilt { eye_rad: latitude_rad(to_eye_m), sun_rad: latitude_rad(sun.direction) };
    let share = ring_share(sun.direction.angle_between(to_eye_m), tilt);
    let (mu_eye, mu_sun) = (tilt.eye_rad.sin().abs(), tilt.sun_rad.sin().abs());
    let unit = rings::illuminance_of_unit(mu_eye, mu_sun, body.radii_m.x / to_eye_m.length())?;
    if share <= 0.0 {
        return None;
    }
    for sun in suns {
        sun.illuminance_lx = sun.illuminance_lx.map(|lx| lx * (1.0 - share));
    }
    // Without the air before it, which takes its part of all that is drawn.
    Some([0, 1, 2].map(|c| light_lx[c] * share / unit / body.seen_through[c].max(1e-9)))
}

/// From world axes, m, to the body's axes, in semi-axes.
fn unit_from_world(body: &Body, time_s: f64) -> DMat3 {
    DMat3::from_diagonal(body.radii_m.recip()) * DMat3::from_quat(body.world_from_body(time_s).conjugate())
}

/// Distance of the nearest that a seen body can have, m.
fn surface_m(objects: &SceneObjects, seen: &BodyDisc) -> f64 {
    seen.distance_m * seen.centre.length() - objects.bodies[seen.body].radii_m.max_element()
}

/// Where an eye stands, and how it sees a body.
struct Seen {
    eye_m: DVec3,
    /// From places relative to the eye to where they are seen, world axes.
    seen_from_place: DMat3,
    /// See [`unit_from_world`].
    unit_from_world: DMat3,
}

fn body_disc(
    (number, light_lx): (usize, [f64; 3]),
    body: &Body,
    &Seen { eye_m, seen_from_place, unit_from_world }: &Seen,
    viewport: &Viewport,
    part: f64,
    (suns, time_s): (&[Sun], f64),
) -> BodyDisc {
    let view_from_world = DMat3::from_quat(viewport.world_from_view.conjugate());
    let view_from_place = view_from_world * seen_from_place;
    let in_view = view_from_place * (body.position_m - eye_m);
    let flat = matches!(viewport.projection, Projection::Perspective(_) | Projection::CubeFace(_));
    let distance_m = in_view.length();
    let on_plane = flat && -in_view.z > LEAST_COSINE * distance_m;
    let (centre, distance_m) =
        if on_plane { (in_view / -in_view.z, -in_view.z) } else { (in_view / distance_m, distance_m) };
    let mut suns = lights_on(body, suns, eye_m);
    let around = match body.emission.and_then(|emission| emission.corona_cd_m2()) {
        // It comes and goes with the disc.
        Some(disc_cd_m2) => Around::Corona(disc_cd_m2.map(|channel| channel * part)),
        None => lit_rings(body, eye_m, light_lx, &mut suns).map_or(Around::Nothing, Around::Rings),
    };
    let body_from_world = body.world_from_body(time_s).conjugate();
    let suns = suns.iter().map(|light| DiscSun {
        direction: (view_from_place * light.direction).normalize(),
        in_body: light.turned(body_from_world),
    });
    let suns = suns.collect();
    BodyDisc {
        body: number,
        centre,
        on_plane,
        distance_m,
        unit_from_view: unit_from_world * view_from_place.inverse(),
        reach_rad: PI,
        part,
        kept: 1.0,
        suns,
        around,
    }
}
