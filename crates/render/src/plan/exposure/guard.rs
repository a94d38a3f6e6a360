//! Lower bound of the exposure from sunlit bodies and asteroids: their surfaces are 17 stops brighter than a night sky, and
//! the light that they scatter in the eye covers the whole picture.
//!
//! The bound is computed on the CPU from the plan, not metered from the picture. A meter would include the stars, so the exposure would depend on the
//! catalogue. A meter also measures only means, not the brightness of surfaces that cover a thousandth of the picture. Finally, a frame that waits
//! for a meter has to be written twice.
//!
//! - **Surfaces.** White is as bright as the lit surfaces, including the corona of a sun, that cover [`SURFACE_SHARE`] of all pictures;
//!   smaller ones may be brighter. Below that share, white rises with the fourth power of the covered share, so that the exposure is
//!   continuous when a planet approaches.
//! - **Sky.** The mean luminance of the sky's hemisphere, regardless of the part that the views show, is at most a fraction of white. This fraction
//!   grows with the luminance, because dim light appears dim to the eye ([`key_of`]). So the sky is darker at dusk than by day, and the night sky
//!   imposes no bound.
//! - **Background.** The veil of glare of all bodies and fields, in the picture or not, is at most [`BACKGROUND_SHARE`] of white in the
//!   darker half of the pictures: the halo next to a sun may be brighter.

use glam::{DMat3, DVec3};

use super::pictures::Picture;
use crate::{
    photometry::{atmosphere::key_of, corona, glare::GlareKernel, rec709::luminance},
    plan::{
        asteroids::glare::Cloud,
        bodies::seen::{Around, BodyPlan},
    },
    scene::{
        SceneObjects,
        bodies::{SeenBody, Sun, lights_on},
    },
    view::Viewport,
};

/// Greatest share of the solid angle of all pictures that lit surfaces brighter than white may cover.
pub const SURFACE_SHARE: f64 = 1e-3;
/// Greatest luminance of the background, relative to white.
pub const BACKGROUND_SHARE: f64 = 0.18;
/// Exponent of white as a function of the covered share, below [`SURFACE_SHARE`].
const GROWTH: i32 = 4;
/// Number of sample points on a disc.
const DISC_POINTS: usize = 256;
/// Number of rings of a corona, and ratio of the radii of consecutive rings.
const CORONA_RINGS: (usize, f64) = (16, 1.22);
/// Number of points of a ring.
const RING_POINTS: usize = 16;
/// The background is evaluated at every n-th direction of a picture; this is n.
const VEIL_STEP: usize = 3;

/// Lit objects.
pub struct Lit<'a> {
    /// Bodies and fields.
    pub objects: &'a SceneObjects,
    /// Light sources.
    pub suns: &'a [Sun],
    /// Position of the camera, m.
    pub camera_m: DVec3,
    /// Every image of every view.
    pub viewports: &'a [Viewport],
    /// Bodies in these images.
    pub bodies: &'a BodyPlan,
    /// Fields of asteroids as each viewport's eye sees them; empty without fields.
    pub clouds: &'a [Vec<Cloud>],
    /// Kernel of glare, and fraction of the light that it scatters; `None`: no glare.
    pub glare: Option<(&'a dyn GlareKernel, f64)>,
}

/// The least luminance of display white that lit objects permit, cd/m^2; 0 if they impose no bound.
pub fn white_for_lit_cd_m2(lit: &Lit<'_>, pictures: &[Picture]) -> f64 {
    let of_sky = lit.objects.local_sky.as_ref().map_or(0.0, |sky| sky.mean_cd_m2 / key_of(sky.mean_cd_m2));
    white_for_surfaces_cd_m2(lit, pictures).max(background_cd_m2(lit, pictures) / BACKGROUND_SHARE).max(of_sky)
}

fn white_for_surfaces_cd_m2(lit: &Lit<'_>, pictures: &[Picture]) -> f64 {
    let all_sr: f64 = pictures.iter().map(|picture| picture.pixel_sums[0]).sum();
    // Luminance and solid angle of every piece of a lit surface in the pictures.
    let mut pieces: Vec<[f64; 2]> = Vec::new();
    for (index, (viewport, picture)) in lit.viewports.iter().zip(pictures).enumerate() {
        discs(lit, index, viewport, picture, &mut pieces);
        for cloud in lit.clouds.get(index).into_iter().flatten() {
            if cloud.surface_cd_m2 > 0.0 && is_in_picture(viewport, cloud.source.direction) {
                pieces.push([cloud.surface_cd_m2, luminance(cloud.source.light) / cloud.surface_cd_m2]);
            }
        }
    }
    pieces.sort_by(|a, b| b[0].total_cmp(&a[0]));
    let (mut white, mut covered_sr) = (0.0_f64, 0.0);
    for [surface_cd_m2, solid_angle_sr] in pieces {
        covered_sr += solid_angle_sr;
        white = white.max(surface_cd_m2 * (covered_sr / (SURFACE_SHARE * all_sr)).min(1.0).powi(GROWTH));
    }
    white
}

/// Adds the lit pieces of the bodies' discs in a picture.
fn discs(lit: &Lit<'_>, index: usize, viewport: &Viewport, picture: &Picture, pieces: &mut Vec<[f64; 2]>) {
    let eye_m = lit.camera_m + viewport.eye_offset_m;
    // The list is sorted by distance, so a body can only be hidden by earlier ones.
    let mut before: Vec<SeenBody<'_>> = Vec::new();
    for disc in &lit.bodies.seen[index] {
        let body = &lit.objects.bodies[disc.body];
        let seen = SeenBody::new(body, eye_m, &lights_on(body, lit.suns, eye_m), lit.objects.time_s);
        let offset_m = body.position_m - eye_m;
        let radius_rad = body.angular_radius_rad(eye_m);
        let cap_sr = 4.0 * std::f64::consts::PI * (0.5 * radius_rad).sin().powi(2);
        let local_sky = lit.objects.local_sky.as_deref();
        let seen_from_place = local_sky.map_or(DMat3::IDENTITY, |sky| sky.seen_body(offset_m, radius_rad));
        let place_from_seen = seen_from_place.inverse();
        let mut take = |direction: DVec3, solid_angle_sr: f64| {
            let Some(hit) = seen.hit(direction) else { return };
            let surface_cd_m2 = luminance(seen.luminance_cd_m2(hit.unit));
            if surface_cd_m2 > 0.0 && before.iter().all(|other| other.hit(direction).is_none()) {
                pieces.push([surface_cd_m2, disc.part * solid_angle_sr]);
            }
        };
        // Sample the disc, or the picture if the disc is larger.
        if cap_sr < picture.pixel_sums[0] {
            for direction in directions_of_cap(offset_m.normalize(), radius_rad) {
                if is_in_picture(viewport, seen_from_place * direction) {
                    take(direction, cap_sr / DISC_POINTS as f64);
                }
            }
        } else {
            for (direction, solid_angle_sr) in &picture.directions {
                take((place_from_seen * (viewport.world_from_view * *direction)).normalize(), *solid_angle_sr);
            }
        }
        // Sample the corona.
        if let Around::Corona(disc_cd_m2) = disc.around {
            let unit_cd_m2 = luminance([0, 1, 2].map(|c| disc_cd_m2[c] * body.seen_through[c]));
            for (direction, distance, solid_angle_sr) in points_of_corona(offset_m.normalize(), radius_rad) {
                let is_open = before.iter().all(|other| other.hit(direction).is_none());
                let seen = seen_from_place * direction;
                let is_above = local_sky.is_none_or(|sky| !sky.hides(seen.normalize()));
                if is_open && is_above && is_in_picture(viewport, seen) {
                    pieces.push([unit_cd_m2 * corona::over_disc(distance), solid_angle_sr]);
                }
            }
        }
        before.push(seen);
    }
}

/// Points of a corona around a sun: direction, distance from its centre in radii, and solid angle that the point represents, sr.
fn points_of_corona(axis: DVec3, radius_rad: f64) -> impl Iterator<Item = (DVec3, f64, f64)> {
    let (right, up) = axis.any_orthonormal_pair();
    let (rings, wider) = CORONA_RINGS;
    (0..rings * RING_POINTS).map(move |i| {
        let (ring, point) = (i / RING_POINTS, i % RING_POINTS);
        let [inner, outer] = [ring, ring + 1].map(|ring| wider.powi(ring as i32));
        let distance = (inner * outer).sqrt();
        let angle = (distance * radius_rad).min(std::f64::consts::PI);
        let (sin, cos) = (point as f64 / RING_POINTS as f64 * std::f64::consts::TAU).sin_cos();
        let direction = axis * angle.cos() + (right * cos + up * sin) * angle.sin();
        let ring_sr = std::f64::consts::PI * radius_rad * radius_rad * (outer * outer - inner * inner);
        (direction, distance, ring_sr / RING_POINTS as f64)
    })
}

/// Directions evenly distributed over a cap: a spiral of equal parts.
fn directions_of_cap(axis: DVec3, radius_rad: f64) -> impl Iterator<Item = DVec3> {
    let (right, up) = axis.any_orthonormal_pair();
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let half_sine = (0.5 * radius_rad).sin();
    (0..DISC_POINTS).map(move |i| {
        let angle = 2.0 * (half_sine * ((i as f64 + 0.5) / DISC_POINTS as f64).sqrt()).asin();
        let (sin, cos) = (i as f64 * golden_angle).sin_cos();
        axis * angle.cos() + (right * cos + up * sin) * angle.sin()
    })
}

fn is_in_picture(viewport: &Viewport, direction: DVec3) -> bool {
    let mapping = viewport.projection.mapping();
    let [width, height] = mapping.size().map(f64::from);
    let in_view = viewport.world_from_view.conjugate() * direction;
    mapping.pixel_from_direction(in_view).is_some_and(|pixel| {
        (0.0..width).contains(&pixel.x)
            && (0.0..height).contains(&pixel.y)
            && mapping.direction_from_pixel(pixel).is_some()
    })
}

/// Median of the veil of everything except the stars, over all pictures and weighted by solid angle, cd/m^2.
fn background_cd_m2(lit: &Lit<'_>, pictures: &[Picture]) -> f64 {
    let Some((kernel, fraction)) = lit.glare else { return 0.0 };
    let mut veils: Vec<[f64; 2]> = Vec::new();
    for (index, (viewport, picture)) in lit.viewports.iter().zip(pictures).enumerate() {
        let bodies = lit.bodies.glare[index].iter().map(|source| (source.whole.0, source.whole.1, 0.0));
        let clouds = lit.clouds.get(index).into_iter().flatten();
        let clouds = clouds.map(|cloud| (cloud.source.direction, cloud.source.light, cloud.source.radius_rad));
        let sources: Vec<(DVec3, f64, f64)> =
            bodies.chain(clouds).map(|(direction, light, radius)| (direction, luminance(light), radius)).collect();
        if sources.is_empty() {
            continue;
        }
        for (direction, solid_angle_sr) in picture.directions.iter().step_by(VEIL_STEP) {
            let direction = viewport.world_from_view * *direction;
            let of_source = |(towards, lx, radius_rad): &(DVec3, f64, f64)| {
                let angle_rad = direction.angle_between(*towards).hypot(*radius_rad).min(std::f64::consts::PI);
                lx * kernel.per_sr(angle_rad)
            };
            veils.push([fraction * sources.iter().map(of_source).sum::<f64>(), *solid_angle_sr]);
        }
    }
    veils.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let half = 0.5 * veils.iter().map(|veil| veil[1]).sum::<f64>();
    let mut passed = 0.0;
    veils
        .into_iter()
        .find(|[_, solid_angle_sr]| {
            passed += solid_angle_sr;
            passed >= half
        })
        .map_or(0.0, |[veil, _]| veil)
}
