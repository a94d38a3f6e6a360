//! Selects the chunks of stars that may be visible in each viewport, and computes bounds of the light of their stars. It also marks chunks that are
//! so near that f32 offsets from the camera are not accurate enough.
//!
//! Bounds are three-dimensional: a sphere around the chunk and, if the camera is nearer to the barycentre than the chunk is, the chunk's cone,
//! widened by the parallax. Both are valid, so the narrower one counts. For a moving camera, the cones are transformed (`crate::relativity`), and the
//! light of the stars changes (`travel`).

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::travel;
use crate::{
    catalogue::{
        chunks::{Chunk, StarSet},
        packed::PackedStar,
    },
    observer::Refraction,
    relativity::Motion,
    units::PARSEC_M,
    view::{
        Viewport,
        projection::{BoundingCone, Projection},
    },
};

/// Kernels reach 1.5 px beyond an edge. A further half pixel covers f32 rounding.
pub const SPLAT_MARGIN_PX: f64 = 2.0;

/// A chunk is near if rounding its origin to f32 would change a star's direction by more than 5e-7 rad (0.1").
const NEAR_SHARE: f64 = 0.12;

/// Ratio of a chunk's greatest Doppler factor to its smallest above which its light is summed star by star.
const WIDE_IN_FLIGHT: f64 = 1.5;

/// Maximum number of viewports of a frame: a chunk has a bit set of 64 bits.
pub const MAX_VIEWPORTS: usize = 64;

/// Inward unit normals, in view axes, of the planes through the eye and the edges of a flat picture (left, right, lower, upper). The
/// picture is widened by `margin_px`. Empty for pictures that are not flat.
pub(crate) fn edge_planes(projection: &Projection, margin_px: f64) -> Vec<DVec3> {
    let tangents = match projection {
        Projection::Perspective(plane) => Some(plane.edge_tangents(margin_px)),
        Projection::CubeFace(face) => Some(face.plane().edge_tangents(margin_px)),
        Projection::Fisheye(_) | Projection::Equirectangular(_) | Projection::Tabulated(_) => None,
    };
    tangents.map_or_else(Vec::new, |[left, right, down, up]| {
        [
            DVec3::new(1.0, 0.0, left),
            DVec3::new(-1.0, 0.0, -right),
            DVec3::new(0.0, 1.0, down),
            DVec3::new(0.0, -1.0, -up),
        ]
        .map(DVec3::normalize)
        .to_vec()
    })
}

/// Field of a viewport, in world axes.
#[derive(Clone, Debug)]
pub(in crate::plan) struct Field {
    eye_pc: DVec3,
    axis: DVec3,
    half_angle_rad: f64,
    /// Inward normals of planes through the eye.
    planes: Vec<DVec3>,
    /// Motion of the observer: the field is in the frame of the moving observer, and the chunks are in the frame of the stars.
    motion: Option<Motion>,
    /// Refraction of the field by air; `None`: there is none.
    refraction: Option<Refraction>,
}

impl Field {
    pub(in crate::plan) fn new(
        viewport: &Viewport,
        &CullSettings { motion, refraction, margin_px, .. }: &CullSettings,
    ) -> Self {
        let cone = viewport.projection.mapping().bounding_cone(margin_px);
        let rotation = DMat3::from_quat(viewport.world_from_view);
        let planes = edge_planes(&viewport.projection, margin_px).into_iter().map(|normal| rotation * normal).collect();
        Self {
            eye_pc: viewport.eye_offset_m / PARSEC_M,
            axis: rotation * cone.axis,
            half_angle_rad: cone.half_angle_rad,
            planes,
            motion,
            refraction,
        }
    }

    /// A round field of a viewport around a direction in view axes.
    pub(in crate::plan) fn round(
        viewport: &Viewport,
        &CullSettings { motion, refraction, .. }: &CullSettings,
        axis: DVec3,
        half_angle_rad: f64,
    ) -> Self {
        Self {
            eye_pc: viewport.eye_offset_m / PARSEC_M,
            axis: viewport.world_from_view * axis,
            half_angle_rad,
            planes: Vec::new(),
            motion,
            refraction,
        }
    }

    /// Position of the eye relative to the camera, pc.
    pub(super) fn eye_pc(&self) -> DVec3 {
        self.eye_pc
    }

    /// Whether a cone of directions, in the stars' frame, intersects the field.
    pub(in crate::plan) fn touches_cone(&self, BoundingCone { axis, half_angle_rad }: BoundingCone) -> bool {
        let (axis, half_angle_rad) =
            self.motion.map_or((axis, half_angle_rad), |motion| motion.seen_cone(axis, half_angle_rad));
        let moved_rad = self.refraction.map_or(0.0, |refraction| refraction.most_rad(axis, half_angle_rad));
        let half_angle_rad = half_angle_rad + moved_rad;
        if axis.angle_between(self.axis) > self.half_angle_rad + half_angle_rad {
            return false;
        }
        half_angle_rad >= FRAC_PI_2 || self.planes.iter().all(|normal| normal.dot(axis) >= -half_angle_rad.sin())
    }

    /// Whether the field may contain a star of a chunk.
    pub(in crate::plan) fn may_see(&self, chunk: &Chunk, camera_pc: DVec3) -> bool {
        let is_whole_sky = self.half_angle_rad >= PI && self.planes.is_empty();
        is_whole_sky
            || cones_of(chunk, camera_pc, origin_of(chunk, camera_pc), self.eye_pc).all(|cone| self.touches_cone(cone))
    }

    /// Whether a convex polygon with these corners, unit vectors, within a cone intersects the field.
    pub(in crate::plan) fn touches_polygon(&self, cone: BoundingCone, corners: &[DVec3]) -> bool {
        let is_exact = self.motion.is_none() && self.refraction.is_none();
        self.touches_cone(cone) && !(is_exact && self.planes.iter().any(|normal| are_outside(*normal, corners)))
    }
}

/// Origin of a chunk minus the camera, pc; zero for directions.
fn origin_of(chunk: &Chunk, camera_pc: DVec3) -> DVec3 {
    if chunk.at_infinity { DVec3::ZERO } else { chunk.origin_pc - camera_pc }
}

/// Whether all directions are outside of a plane.
fn are_outside(normal: DVec3, directions: &[DVec3]) -> bool {
    directions.iter().all(|direction| normal.dot(*direction) < 0.0)
}

/// Cones in the stars' frame, each of which contains the stars of a chunk for an eye at `eye_pc` from the camera. Without cones, the stars may be in
/// any direction.
fn cones_of(chunk: &Chunk, camera_pc: DVec3, origin_pc: DVec3, eye_pc: DVec3) -> impl Iterator<Item = BoundingCone> {
    // The cone as seen from the barycentre, widened by the greatest change of a star's direction between the barycentre and the eye.
    let travelled_pc = (camera_pc + eye_pc).length();
    let turned_rad = if chunk.at_infinity {
        Some(0.0)
    } else {
        (travelled_pc < chunk.nearest_pc).then(|| (travelled_pc / chunk.nearest_pc).asin())
    };
    let from_barycentre = turned_rad
        .map(|turned_rad| BoundingCone { axis: chunk.axis, half_angle_rad: chunk.half_angle_rad + turned_rad });
    // The sphere.
    let to_centre = origin_pc - eye_pc;
    let distance_pc = to_centre.length();
    let sphere = (!chunk.at_infinity && distance_pc > chunk.radius_pc).then(|| BoundingCone {
        axis: to_centre / distance_pc,
        half_angle_rad: (chunk.radius_pc / distance_pc).min(1.0).asin() + 1e-6,
    });
    from_barycentre.into_iter().chain(sphere)
}

/// A chunk that may be visible in a viewport.
#[derive(Clone, Debug, PartialEq)]
pub struct VisibleChunk {
    /// Index of the chunk.
    pub chunk: usize,
    /// Chunk origin minus camera, pc.
    pub origin_pc: DVec3,
    /// Bit i: visible in viewport i.
    pub viewports: u64,
    /// Number of stars, in order of decreasing brightness, that can reach the faintest drawn illuminance.
    pub count: u32,
    /// Whether the positions of its stars need f64.
    pub near: bool,
    /// Upper bounds of the illuminance of its brightest star and of all its stars together, lx.
    pub brightest_lx: f64,
    /// See `brightest_lx`.
    pub total_lx: f64,
}

/// Parameters of culling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CullSettings {
    /// Stars fainter than this are not drawn, lx.
    pub faintest_lx: f64,
    /// Distance beyond the border of a picture from which a star may reach into it, pixels: at least [`SPLAT_MARGIN_PX`].
    pub margin_px: f64,
    /// False: every chunk is visible in every viewport, to measure the benefit of culling.
    pub enabled: bool,
    /// Motion of the camera; `None`: it is at rest.
    pub motion: Option<Motion>,
    /// Refraction around the camera; `None`: there is none.
    pub refraction: Option<Refraction>,
}

/// Selects the chunks that may be visible in the viewports from `camera_pc`.
pub fn visible_chunks(
    set: &StarSet,
    camera_pc: DVec3,
    viewports: &[Viewport],
    settings: CullSettings,
) -> Vec<VisibleChunk> {
    let of_viewport = |(index, viewport)| (index, Field::new(viewport, &settings));
    let fields: Vec<(usize, Field)> = viewports.iter().enumerate().map(of_viewport).collect();
    visible_in(set, camera_pc, viewports, &fields, settings)
}

/// Selects the chunks that may be visible in fields of the viewports. Each field comes with the index of its viewport.
pub(in crate::plan) fn visible_in(
    set: &StarSet,
    camera_pc: DVec3,
    viewports: &[Viewport],
    fields: &[(usize, Field)],
    settings: CullSettings,
) -> Vec<VisibleChunk> {
    let eyes_pc = distinct_eyes_pc(viewports);
    set.chunks
        .par_iter()
        .enumerate()
        .filter_map(|(index, chunk)| look_at(set, index, chunk, camera_pc, &eyes_pc, fields, settings))
        .collect()
}

fn look_at(
    set: &StarSet,
    index: usize,
    chunk: &Chunk,
    camera_pc: DVec3,
    eyes_pc: &[DVec3],
    fields: &[(usize, Field)],
    settings: CullSettings,
) -> Option<VisibleChunk> {
    let origin_pc = origin_of(chunk, camera_pc);
    let farthest_eye_pc = eyes_pc.iter().map(|eye| eye.length()).fold(0.0, f64::max);
    // The least distance of a star from any eye; at infinity the light is constant.
    let nearest_pc = if chunk.at_infinity {
        1.0
    } else {
        (origin_pc.length() - chunk.radius_pc).max(chunk.nearest_pc - camera_pc.length()) - farthest_eye_pc
    };
    let near = !chunk.at_infinity && nearest_pc < NEAR_SHARE * origin_pc.length() + 1e-12;
    // Viewports in which the chunk may be visible.
    let viewports: u64 = fields
        .iter()
        .filter(|(_, field)| !settings.enabled || field.may_see(chunk, camera_pc))
        .fold(0, |set, (index, _)| set | 1 << index);
    if viewports == 0 {
        return None;
    }
    // For a moving camera, a star can be brighter or fainter than its distance implies.
    let boost = settings.motion.map(|motion| {
        let dopplers = doppler_range(&motion, chunk, camera_pc, origin_pc, eyes_pc);
        (travel::boost(&set.spectra()[index], chunk.brightest_lx, dopplers), dopplers)
    });
    // Keep the factor above 0: 0 divided by 0 would give NaN.
    let of_a_star = boost.map_or(1.0, |(boost, _)| boost.of_a_star.max(f64::MIN_POSITIVE));
    let needed_lx = settings.faintest_lx * nearest_pc * nearest_pc * (1.0 - 1e-6) / of_a_star;
    let count = if near || chunk.faintest_lx >= needed_lx {
        chunk.count
    } else {
        set.stars_of(chunk).partition_point(|star| star.illuminance_at_1_pc_lx() >= needed_lx) as u32
    };
    if count == 0 {
        return None;
    }
    // For a chunk with a wide range of Doppler factors, only the sum of the light of its stars is a useful bound.
    let wide = boost.is_some_and(|(_, [lowest, highest])| highest > WIDE_IN_FLIGHT * lowest);
    let (brightest_lx, total_lx) = if near || wide {
        // At infinity the position is a direction, the same for every eye.
        let eyes_pc = if chunk.at_infinity { &[DVec3::ZERO] } else { eyes_pc };
        let lights =
            near_stars(set, chunk, origin_pc).map(|(place, star)| most_light(place, star, eyes_pc, settings.motion));
        lights.fold((0.0_f64, 0.0), |(most, sum), lx| (most.max(lx), sum + lx))
    } else {
        // The bounds of the chunk were computed from f64 positions, but its stars are stored as f32 offsets: include a margin for rounding.
        let spread = (1.0 + 1e-5) / (nearest_pc * nearest_pc);
        let (brightest_lx, of_all) =
            boost.map_or((chunk.brightest_lx, 1.0), |(boost, _)| (boost.brightest_lx, boost.of_all));
        (brightest_lx * spread, chunk.total_lx * of_all * spread)
    };
    Some(VisibleChunk { chunk: index, origin_pc, viewports, count, near, brightest_lx, total_lx })
}

/// The range of Doppler factors of a chunk's stars for any of the eyes.
fn doppler_range(motion: &Motion, chunk: &Chunk, camera_pc: DVec3, origin_pc: DVec3, eyes_pc: &[DVec3]) -> [f64; 2] {
    let all = [motion.doppler_behind(), 1.0 / motion.doppler_behind()];
    let for_eye = |eye_pc: DVec3| {
        cones_of(chunk, camera_pc, origin_pc, eye_pc)
            .map(|cone| motion.doppler_range(cone.axis, cone.half_angle_rad))
            .fold(all, |[lowest, highest], [low, high]| [lowest.max(low), highest.min(high)])
    };
    // Both cones contain the stars, so the ranges overlap, except for rounding.
    let ranges = eyes_pc.iter().map(|eye| for_eye(*eye));
    let [lowest, highest] = ranges
        .fold([f64::INFINITY, 0.0], |[lowest, highest]: [f64; 2], [low, high]| [lowest.min(low), highest.max(high)]);
    [lowest.min(highest), highest.max(lowest)]
}

/// Stars of a chunk with their f64 positions relative to the camera, pc.
pub fn near_stars<'a>(
    set: &'a StarSet,
    chunk: &Chunk,
    origin_pc: DVec3,
) -> impl Iterator<Item = (DVec3, &'a PackedStar)> + use<'a> {
    set.stars_of(chunk).iter().map(move |star| (origin_pc + Vec3::from_array(star.offset_pc).as_dvec3(), star))
}

/// The distinct positions of the viewports' eyes relative to the camera, pc.
pub fn distinct_eyes_pc(viewports: &[Viewport]) -> Vec<DVec3> {
    let mut eyes: Vec<DVec3> = Vec::new();
    for eye in viewports.iter().map(|viewport| viewport.eye_offset_m / PARSEC_M) {
        if !eyes.contains(&eye) {
            eyes.push(eye);
        }
    }
    eyes
}

/// Greatest illuminance of a star at `place` (pc from the camera) at any of the eyes, lx.
pub fn most_light(place: DVec3, star: &PackedStar, eyes_pc: &[DVec3], motion: Option<Motion>) -> f64 {
    eyes_pc.iter().map(|eye| light_at(place - *eye, star, motion)).fold(0.0, f64::max)
}

/// Illuminance of a star at `place` (pc from the eye), lx; 0 for a star at the eye itself, where it has no direction.
pub fn light_at(place: DVec3, star: &PackedStar, motion: Option<Motion>) -> f64 {
    let distance_squared = place.length_squared();
    if distance_squared > 0.0 {
        let factor =
            motion.map_or(1.0, |motion| travel::light_factor(star.temperature_step(), motion.doppler_of(place)));
        star.illuminance_at_1_pc_lx() / distance_squared * factor
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::{
        catalogue::StarRecord,
        view::{
            Part,
            projection::{CubeFace, Face, Fisheye, FisheyeMapping, Perspective},
        },
    };

    fn sky() -> StarSet {
        let records = (0..30_000)
            .map(|i| {
                let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 30_000.0;
                let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
                let direction = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
                let distance_known = i % 5 != 0;
                let distance_pc = if distance_known { 2.0 + f64::from(i % 97) } else { 1.0 };
                StarRecord { position: direction * distance_pc, magnitude: 5.0, temperature_k: 5772.0, distance_known }
            })
            .collect();
        StarSet::from_records(records)
    }

    fn viewport(projection: Projection, world_from_view: DQuat) -> Viewport {
        Viewport {
            view: 0,
            part: Part::Whole,
            projection,
            world_from_view,
            eye_offset_m: DVec3::ZERO,
            viewing_circle_m: 0.0,
        }
    }

    fn viewports() -> Vec<Viewport> {
        let turn = DQuat::from_rotation_y(1.0) * DQuat::from_rotation_x(0.4);
        vec![
            viewport(Projection::Perspective(Perspective::symmetric([64, 36], 1.0).unwrap()), turn),
            viewport(Projection::Perspective(Perspective::symmetric([64, 64], 2.9).unwrap()), DQuat::IDENTITY),
            viewport(Projection::CubeFace(CubeFace::new(Face::Up, 32).unwrap()), Face::Up.cube_from_face()),
            viewport(Projection::Fisheye(Fisheye::new([64, 64], FisheyeMapping::Equidistant, 3.0).unwrap()), turn),
            viewport(Projection::Fisheye(Fisheye::new([64, 64], FisheyeMapping::Orthographic, 3.1).unwrap()), turn),
        ]
    }

    /// Test a camera at rest, and fast cameras in several directions.
    fn motions() -> [Option<Motion>; 5] {
        [DVec3::ZERO, DVec3::X * 0.3, DVec3::new(-0.5, 0.6, 0.45), DVec3::NEG_Z * 0.99, DVec3::Y * 0.9999]
            .map(Motion::new)
    }

    /// Every star that touches a pixel of a viewport must be in a chunk that is visible there: from the barycentre, from
    /// among the stars and from outside.
    #[test]
    fn no_star_in_view_is_culled() {
        let set = sky();
        let viewports = viewports();
        let places =
            [DVec3::ZERO, DVec3::new(0.5, 0.2, 0.0), DVec3::new(30.0, -20.0, 10.0), DVec3::new(0.0, 400.0, 0.0)];
        // Dense air, which raises many stars near the horizon.
        let air = Refraction { zenith: DVec3::new(0.6, 0.64, 0.48), density: 1.2 };
        let eyes = motions().map(|motion| (motion, None)).into_iter().chain([(None, Some(air))]);
        let eyes: Vec<(Option<Motion>, Option<Refraction>)> = eyes.collect();
        let all = places.iter().flat_map(|place| eyes.iter().map(move |eye| (*place, *eye)));
        for (camera_pc, (motion, refraction)) in all {
            let settings =
                CullSettings { faintest_lx: 0.0, enabled: true, motion, refraction, margin_px: SPLAT_MARGIN_PX };
            let visible = visible_chunks(&set, camera_pc, &viewports, settings);
            let mut culled_pairs = 0;
            for (index, chunk) in set.chunks.iter().enumerate() {
                let seen_by = visible.iter().find(|v| v.chunk == index).map_or(0, |v| v.viewports);
                for (i, viewport) in viewports.iter().enumerate() {
                    if seen_by & (1 << i) != 0 {
                        continue;
                    }
                    culled_pairs += 1;
                    for star in set.stars_of(chunk) {
                        let offset = Vec3::from_array(star.offset_pc).as_dvec3();
                        let place = if chunk.at_infinity { offset } else { chunk.origin_pc + offset - camera_pc };
                        let seen = motion.map_or(place, |motion| motion.seen(place));
                        let seen = refraction.map_or(seen, |refraction| refraction.seen(seen));
                        let direction = viewport.world_from_view.conjugate() * seen;
                        let mapping = viewport.projection.mapping();
                        let Some(pixel) = mapping.pixel_from_direction(direction) else { continue };
                        let [width, height] = mapping.size().map(f64::from);
                        let in_square =
                            pixel.x > -1.5 && pixel.y > -1.5 && pixel.x < width + 1.5 && pixel.y < height + 1.5;
                        let circle = matches!(viewport.projection, Projection::Fisheye(_));
                        let in_circle = (pixel - glam::DVec2::new(width, height) / 2.0).length() < width / 2.0 + 1.5;
                        assert!(
                            !in_square || (circle && !in_circle),
                            "{camera_pc} {motion:?} viewport {i}: star at {pixel} was culled"
                        );
                    }
                }
            }
            assert!(culled_pairs > set.chunks.len(), "hardly anything was culled from {camera_pc}, {motion:?}");
        }
    }

    #[test]
    fn the_light_bound_holds_from_anywhere() {
        let set = sky();
        let places = [DVec3::ZERO, DVec3::new(3.0, 2.0, 1.0), DVec3::new(0.0, 50.0, 0.0)];
        for (camera_pc, motion) in places.into_iter().flat_map(|place| motions().map(|motion| (place, motion))) {
            let settings =
                CullSettings { faintest_lx: 0.0, enabled: false, motion, refraction: None, margin_px: SPLAT_MARGIN_PX };
            for visible in visible_chunks(&set, camera_pc, &viewports()[..1], settings) {
                let chunk = &set.chunks[visible.chunk];
                let lights =
                    near_stars(&set, chunk, visible.origin_pc).map(|(place, star)| light_at(place, star, motion));
                let (most, total) = lights.fold((0.0_f64, 0.0), |(most, sum), lx| (most.max(lx), sum + lx));
                assert!(total <= visible.total_lx * (1.0 + 1e-9), "{motion:?}: {total} > {}", visible.total_lx);
                assert!(most <= visible.brightest_lx * (1.0 + 1e-9), "{motion:?}: {most} > {}", visible.brightest_lx);
            }
        }
    }

    #[test]
    fn a_magnitude_limit_shortens_chunks_without_losing_a_star() {
        let set = sky();
        let limit_lx = crate::units::illuminance_lx_from_magnitude(6.0);
        for motion in motions() {
            let settings = CullSettings {
                faintest_lx: limit_lx,
                enabled: false,
                motion,
                refraction: None,
                margin_px: SPLAT_MARGIN_PX,
            };
            let bright = visible_chunks(&set, DVec3::ZERO, &viewports()[..1], settings);
            let kept: u32 = bright.iter().map(|visible| visible.count).sum();
            assert!(kept < 30_000, "{motion:?}");
            for (index, chunk) in set.chunks.iter().enumerate() {
                let count = bright.iter().find(|v| v.chunk == index).map_or(0, |v| v.count);
                for (place, star) in near_stars(&set, chunk, chunk.origin_pc).skip(count as usize) {
                    assert!(light_at(place, star, motion) < limit_lx);
                }
            }
        }
    }
}
