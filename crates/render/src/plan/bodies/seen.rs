//! Bodies as the eye of each viewport sees them: which ones are drawn as discs, nearest first, which as points of light, and the light that
//! each sends to the eye.
//!
//! A body smaller than [`POINT_BELOW_PX`] is a point, one larger than [`DISC_FROM_PX`] a disc. In between, its light is divided between a point and a
//! disc, so that the change of form is not visible.

use std::{
    f64::consts::PI,
    sync::{Arc, Weak},
};

use glam::{DMat3, DVec2, DVec3};

use super::{
    light::illuminance_of,
    meeting::{self, Round},
    ring_light::{has_rings, lit_rings},
};
use crate::plan::{
    glare::objects::{Source, body_sources},
    stars::cull::MAX_VIEWPORTS,
};
use crate::{
    photometry::{corona, glare::GlareKernel, rec709::luminance, rings},
    scene::{
        SceneObjects,
        bodies::{Body, Light, Sun, lights_on},
    },
    view::{
        Viewport,
        projection::{FisheyeMapping, Projection, pixel_centre},
    },
};

/// Diameter below which a body is a point, pixels.
pub const POINT_BELOW_PX: f64 = 2.0;
/// Diameter from which a body is only a disc, pixels.
pub const DISC_FROM_PX: f64 = 4.0;
/// Least cosine between the direction of a body and the axis of a flat picture for which its direction is given as tangents.
const LEAST_COSINE: f64 = 0.05;

/// A point of light that is not a star.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSource {
    /// Position relative to the camera, world axes, m.
    pub offset_m: DVec3,
    /// Intensity, linear Rec. 709, cd.
    pub intensity_cd: [f64; 3],
    /// Surfaces that are nearer than the position by less than this do not hide the point, m.
    pub radius_m: f64,
    /// Bit i: visible in viewport i.
    pub viewports: u64,
}

/// A body that a viewport shows as a disc.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyDisc {
    /// Index in the scene.
    pub body: usize,
    /// Direction of its centre, view axes: a tangent vector (z = -1) if `on_plane`, otherwise a unit vector.
    pub centre: DVec3,
    /// See `centre`.
    pub on_plane: bool,
    /// Distance of the centre, m per length of `centre`.
    pub distance_m: f64,
    /// Transforms view axes (m) to the axes of the body (in semi-axes).
    pub unit_from_view: DMat3,
    /// Angle from the centre beyond which no pixel centre shows any part of the body, rad.
    pub reach_rad: f64,
    /// Fraction of the body's light that is drawn as the disc.
    pub part: f64,
    /// Factor on its luminance, for the light that the body scatters onto itself; 1 if there is none.
    pub kept: f64,
    /// Suns that light the body.
    pub suns: Vec<DiscSun>,
    /// Rings or corona around the body.
    pub around: Around,
}

/// Rings or corona of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Around {
    /// Nothing, or dark rings.
    #[default]
    Nothing,
    /// Rings: luminance divided by their reflectance ([`crate::photometry::rings`]), linear Rec. 709, cd/m^2.
    Rings([f64; 3]),
    /// A corona ([`crate::photometry::corona`]): mean luminance of the disc, linear Rec. 709, cd/m^2.
    Corona([f64; 3]),
}

impl Around {
    /// Luminance by which rings or corona are scaled.
    pub fn light_cd_m2(self) -> [f64; 3] {
        match self {
            Self::Nothing => [0.0; 3],
            Self::Rings(light) | Self::Corona(light) => light,
        }
    }
}

/// A sun as seen from a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscSun {
    /// Direction, unit vector, view axes.
    pub direction: DVec3,
    /// Its light at the body, in the body's axes.
    pub in_body: Light,
}

/// The bodies of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyPlan {
    /// Bodies drawn as discs in each viewport, nearest first.
    pub seen: Vec<Vec<BodyDisc>>,
    /// Whether pixels of each viewport may show the limb of a body in front of another body or of a corona.
    pub crosses: Vec<bool>,
    /// Bodies drawn as points, with the fraction of their light that the point has.
    pub points: Vec<PointSource>,
    /// Light of every body at each viewport's eye: index of the body, and illuminance, lx.
    pub lights: Vec<Vec<(usize, [f64; 3])>>,
    /// The same light, but only of bodies in the picture.
    pub in_view: Vec<Vec<(usize, [f64; 3])>>,
    /// Sources of glare for each viewport's eye.
    pub glare: Vec<Vec<Source>>,
}

impl PointSource {
    /// Illuminance at an eye that is at `eye_m` relative to the camera, lx; 0 at the point itself.
    pub fn light_at_lx(&self, eye_m: DVec3) -> f64 {
        let squared = (self.offset_m - eye_m).length_squared();
        if squared > 0.0 { luminance(self.intensity_cd) / squared } else { 0.0 }
    }
}

impl BodyPlan {
    /// Lets each disc keep the light that it scatters onto itself. `kernel` scatters `fraction` of all light.
    pub fn keep_own_glare(&mut self, kernel: &dyn GlareKernel, fraction: f64) {
        for (seen, sources) in self.seen.iter_mut().zip(&self.glare) {
            for disc in seen {
                let own = sources.iter().find(|source| source.body == disc.body);
                disc.kept = own.map_or(1.0, |source| source.kept(kernel, fraction));
            }
        }
    }

    /// Illuminance of the bodies in all pictures, summed over the viewports, lx.
    pub fn light_in_view_lx(&self) -> f64 {
        let of_viewport = |lights: &Vec<(usize, [f64; 3])>| lights.iter().map(|(_, lx)| luminance(*lx)).sum::<f64>();
        self.in_view.iter().map(of_viewport).sum()
    }
}

/// Fraction of the light of a body of this diameter that is drawn as a disc.
fn disc_part(diameter_px: f64) -> f64 {
    let t = ((diameter_px - POINT_BELOW_PX) / (DISC_FROM_PX - POINT_BELOW_PX)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Angle across the longer side of the pixel that shows a direction, rad. Outside the picture, the nearest pixel is used.
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

/// Light of every body at an eye, and its sources of glare. Independent of the eye's orientation and picture.
#[derive(Clone, Debug)]
struct LightsAt {
    eye_m: DVec3,
    lights: Vec<(usize, [f64; 3])>,
    glare: Vec<Source>,
}

/// Light of bodies at the eyes of the last plans, kept while the objects are the same, since it takes most of the time of a plan.
#[derive(Clone, Debug, Default)]
pub struct HeldLights {
    objects: Weak<SceneObjects>,
    eyes: Vec<LightsAt>,
}

impl HeldLights {
    fn at_eye(&mut self, objects: &Arc<SceneObjects>, suns: &[Sun], eye_m: DVec3) -> &LightsAt {
        if !self.objects.upgrade().is_some_and(|held| Arc::ptr_eq(&held, objects)) {
            *self = Self { objects: Arc::downgrade(objects), eyes: Vec::new() };
        }
        let held = self.eyes.iter().position(|held| held.eye_m == eye_m);
        let index = held.unwrap_or_else(|| {
            if self.eyes.len() >= MAX_VIEWPORTS {
                // The positions of a moving camera's eyes do not recur.
                self.eyes.clear();
            }
            let light = |body: &Arc<Body>| illuminance_of(body, eye_m, suns, objects.time_s);
            let lights: Vec<(usize, [f64; 3])> = objects.bodies.iter().map(light).enumerate().collect();
            let glare = body_sources(objects, eye_m, &lights, suns);
            self.eyes.push(LightsAt { eye_m, lights, glare });
            self.eyes.len() - 1
        });
        &self.eyes[index]
    }
}

/// Plans the bodies, lit by `suns` (those of the scene), for a camera at `camera_m`, world axes. Points reach `margin_px` beyond the border of
/// a picture.
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
        // Bodies that may be visible in the viewport.
        let eye_m = camera_m + viewport.eye_offset_m;
        let LightsAt { lights, glare, .. } = held.at_eye(objects, suns, eye_m).clone();
        let mut candidates: Vec<Candidate<'_>> = Vec::new();
        let mut in_view_of: Vec<(usize, [f64; 3])> = Vec::new();
        let cone = viewport.projection.mapping().bounding_cone(margin_px);
        for (body, light) in objects.bodies.iter().zip(&lights) {
            let offset_m = body.position_m - eye_m;
            let distance_m = offset_m.length();
            let largest_m = body.radii_m.max_element();
            // From inside, a body is not visible.
            let unit_from_world = unit_from_world(body, objects.time_s);
            if unit_from_world.mul_vec3(offset_m).length() <= 1.0 {
                continue;
            }
            // Air changes the apparent direction and flattens the body.
            let radius_rad = (largest_m / distance_m).min(1.0).asin();
            let seen_from_place = match &objects.local_sky {
                Some(sky) => sky.seen_body(offset_m, radius_rad),
                None => DMat3::IDENTITY,
            };
            let seen_m = seen_from_place * offset_m;
            let in_view = viewport.world_from_view.conjugate().mul_vec3(seen_m);
            // If the eye is within rings or a corona, it sees them in every direction.
            let wide_rad = |radii: f64| {
                let wide_m = radii * largest_m;
                if wide_m < distance_m { (wide_m / distance_m).asin() } else { PI }
            };
            // A corona has a negligible fraction of the light.
            let lit_rad = wide_rad(if has_rings(body) { rings::OUTER } else { 1.0 });
            let has_corona = body.emission.is_some_and(|emission| emission.corona);
            let widest_rad = if has_corona { wide_rad(corona::OUTER) } else { lit_rad };
            // Parallax between the centre of the viewing circle and an eye on the circle.
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
        // Divide the light of each between a disc and a point.
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
        plan.crosses.push(may_cross(&seen));
        plan.seen.push(seen);
        plan.in_view.push(in_view_of);
        plan.glare.push(glare);
        plan.lights.push(lights);
    }
    plan
}

/// A body that may be visible in a picture.
struct Candidate<'a> {
    body: &'a Body,
    light: (usize, [f64; 3]),
    seen: Round,
    /// Apparent position relative to the eye, world axes.
    seen_m: DVec3,
    /// See [`BodyDisc::reach_rad`].
    reach_rad: f64,
    place: Seen,
}

/// Greatest distance between a limb and the centre of a pixel that shows it, rad. Shaders use half the diagonal of the pixel. This is an upper
/// bound if the central pixel is the largest.
fn limb_rad(projection: &Projection) -> f64 {
    let middle_is_largest = match projection {
        Projection::Perspective(_) | Projection::CubeFace(_) | Projection::Equirectangular(_) => true,
        Projection::Fisheye(fisheye) => {
            matches!(fisheye.mapping, FisheyeMapping::Equidistant | FisheyeMapping::Stereographic)
        }
        Projection::Tabulated(_) => false,
    };
    // Round pictures: centres outside the circle have no direction, so the reach is unlimited.
    if middle_is_largest { 1.5 * projection.middle_pixel_rad() } else { PI }
}

/// Whether a pixel may show parts of two of these bodies, or a limb in front of a corona. The globe of a flattened star is in front of the star's own
/// corona.
fn may_cross(seen: &[BodyDisc]) -> bool {
    // Margin for the rounding of directions on the adapter.
    const MARGIN_RAD: f64 = 1e-5;
    let has_corona = seen.iter().any(|disc| matches!(disc.around, Around::Corona(_)));
    let meet = |a: &BodyDisc, b: &BodyDisc| {
        a.centre.angle_between(b.centre) <= 1.002 * (a.reach_rad + b.reach_rad) + MARGIN_RAD
    };
    has_corona || seen.iter().enumerate().any(|(index, a)| seen[..index].iter().any(|b| meet(a, b)))
}

/// Transforms world axes (m) to the axes of the body (in semi-axes).
fn unit_from_world(body: &Body, time_s: f64) -> DMat3 {
    DMat3::from_diagonal(body.radii_m.recip()) * DMat3::from_quat(body.world_from_body(time_s).conjugate())
}

/// Least distance of any part of the body, m.
fn surface_m(objects: &SceneObjects, seen: &BodyDisc) -> f64 {
    seen.distance_m * seen.centre.length() - objects.bodies[seen.body].radii_m.max_element()
}

/// An eye and its view of a body.
struct Seen {
    eye_m: DVec3,
    /// Transforms positions relative to the eye to apparent positions, world axes.
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
        // Fades with the disc.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(angle_rad: f64, reach_rad: f64) -> BodyDisc {
        BodyDisc {
            body: 0,
            centre: DVec3::new(angle_rad.sin(), 0.0, -angle_rad.cos()),
            on_plane: false,
            distance_m: 1.0,
            unit_from_view: DMat3::IDENTITY,
            reach_rad,
            part: 1.0,
            kept: 1.0,
            suns: Vec::new(),
            around: Around::Nothing,
        }
    }

    #[test]
    fn bodies_cross_if_their_reaches_meet_or_one_has_a_corona() {
        assert!(!may_cross(&[]) && !may_cross(&[disc(0.0, 0.5)]));
        assert!(may_cross(&[disc(0.0, 0.1), disc(1.0, 0.1), disc(1.19, 0.1)]));
        assert!(!may_cross(&[disc(0.0, 0.1), disc(1.0, 0.1), disc(1.21, 0.1)]));
        // A tangent of the same direction.
        let on_plane = BodyDisc { centre: DVec3::new(0.19_f64.tan(), 0.0, -1.0), on_plane: true, ..disc(0.0, 0.1) };
        assert!(may_cross(&[disc(0.0, 0.1), on_plane]));
        assert!(may_cross(&[BodyDisc { around: Around::Corona([1.0; 3]), ..disc(0.0, 0.1) }]));
    }
}
