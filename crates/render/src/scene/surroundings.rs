//! The surroundings of an observer on the ground: the ground itself, up to the horizon, and the air.
//!
//! The ground hides everything below the horizon, which may be a line of hills. It reflects the light of the sky and of
//! the sources in it, as a Lambert surface or with a picture (`landscape`). The air absorbs a part of the light that
//! passes through it, scatters light of the sources in the sky ([`crate::photometry::atmosphere`]), and refracts it
//! ([`crate::observer::refraction`]). Directions are apparent ones, unless they are stated to be without air.

use std::{
    f64::consts::{FRAC_PI_2, PI, TAU},
    sync::Arc,
};

use glam::{DMat3, DVec3};

use super::{
    SceneObjects,
    bodies::{Body, hidden_share, lights_on, reflected_lx, suns},
    landscape::Landscape,
};
use crate::observer::{Observer, RefractingAir, Refraction};
use crate::photometry::{atmosphere::Air, rec709::luminance, sky_light::SkyTable};

/// Number of sources whose light the air scatters: the brightest ones.
pub const MOST_SOURCES: usize = 2;
/// Beyond this distance from the observer's place, a camera is not on the ground, m.
const ON_GROUND_M: f64 = 1000.0;
/// Fraction of the Sun's light that the air outside the shadow scatters into the shadow of a total eclipse, from all sides: 1 to 4 lx of 1e5 lx (S.
/// M. Silverman and E. G. Mullen, Applied Optics 14, 2838, 1975).
const LEAST_OF_ECLIPSED: f64 = 2.7e-5;
/// Fraction of the light of a clear day that comes from the sky and not directly from the sun, for a high sun.
const SKY_OF_HIGH_SUN: f64 = 0.13;
/// Objects closer than this are not refracted, m.
pub const BEYOND_AIR_M: f64 = 1e5;
/// Sources whose scattered light is below this fraction of the airglow are ignored, such as the Sun at night.
const LEAST_OF_GLOW: f64 = 1e-6;
/// Interval at which the scattering of starlight in the eye is recomputed, s.
const STARS_S: f64 = 60.0;
/// Numbers of directions over which the light of the sky is summed: altitudes, and azimuths at each altitude.
const NODES: [usize; 2] = [12, 16];

/// The upper boundary of the ground: altitudes at azimuths, interpolated linearly.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Horizon {
    /// Points of azimuth and altitude, rad. Azimuths rise from 0 to 2 pi; two equal azimuths form a vertical wall. Empty: the same altitude all
    /// around.
    points: Vec<[f64; 2]>,
    /// That altitude, rad.
    level_rad: f64,
}

/// Number of altitudes of a horizon in the table for shaders, evenly spaced from the north.
pub const HORIZON_STEPS: usize = 720;

impl Horizon {
    /// The line through points of azimuth and altitude, rad, with azimuths rising from 0 to 2 pi.
    pub fn new(points: Vec<[f64; 2]>) -> Self {
        Self { points, level_rad: 0.0 }
    }

    /// The horizon at the same altitude all around, rad.
    pub fn level(level_rad: f64) -> Self {
        Self { points: Vec::new(), level_rad }
    }

    /// Altitude without points, rad.
    pub fn level_rad(&self) -> f64 {
        self.level_rad
    }

    /// Whether it is at the same altitude all around.
    pub fn is_flat(&self) -> bool {
        self.points.is_empty()
    }

    /// Altitude at an azimuth, rad.
    pub fn altitude_rad(&self, azimuth_rad: f64) -> f64 {
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else {
            return self.level_rad;
        };
        let azimuth = azimuth_rad.rem_euclid(TAU);
        let after = self.points.partition_point(|[at, _]| *at <= azimuth);
        let before = if after == 0 { [last[0] - TAU, last[1]] } else { self.points[after - 1] };
        let next = self.points.get(after).copied().unwrap_or([first[0] + TAU, first[1]]);
        let span = next[0] - before[0];
        let part = if span > 0.0 { (azimuth - before[0]) / span } else { 0.0 };
        before[1] + part * (next[1] - before[1])
    }

    /// Its greatest altitude, rad.
    pub fn highest_rad(&self) -> f64 {
        self.points.iter().map(|[_, altitude_rad]| *altitude_rad).reduce(f64::max).unwrap_or(self.level_rad)
    }

    /// Sines of its altitudes in [`HORIZON_STEPS`] steps.
    pub fn sines(&self) -> Vec<f32> {
        (0..HORIZON_STEPS)
            .map(|step| self.altitude_rad(step as f64 / HORIZON_STEPS as f64 * TAU).sin() as f32)
            .collect()
    }
}

/// The surroundings of an observer; see the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// The air; `None` for no air.
    pub air: Option<Air>,
    /// The refracting air; `None` for no refraction.
    pub refraction: Option<RefractingAir>,
    /// The ground; `None` if it is transparent.
    pub ground: Option<Ground>,
}

/// The ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// Its upper boundary.
    pub horizon: Horizon,
    /// Fraction of light that it reflects, 0 to 1.
    pub albedo: f64,
    /// A picture of the ground. If there is one, its outline replaces the horizon.
    pub landscape: Option<Arc<Landscape>>,
}

/// A source of light in the sky.
#[derive(Clone, Debug, PartialEq)]
pub struct SkySource {
    /// Unit vector to its apparent position, world axes.
    pub direction: DVec3,
    /// Its illuminance outside of the air, linear Rec. 709, lx.
    pub light_lx: [f64; 3],
    /// Sky luminance for a source at its altitude.
    pub table: Arc<SkyTable>,
}

/// The sky and ground around an observer at a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalSky {
    /// Rows: east, zenith, south.
    pub horizon_from_world: DMat3,
    /// The air.
    pub air: Option<Air>,
    /// Refraction.
    pub refraction: Option<Refraction>,
    /// The horizon; `None` without ground.
    pub horizon: Option<Horizon>,
    /// Sources whose light air scatters, at most [`MOST_SOURCES`].
    pub sources: Vec<SkySource>,
    /// The picture of the ground.
    pub landscape: Option<Arc<Landscape>>,
    /// Luminance of the ground, linear Rec. 709, cd/m^2.
    pub ground_cd_m2: [f64; 3],
    /// Luminance of a white horizontal surface, linear Rec. 709, cd/m^2.
    pub white_cd_m2: [f64; 3],
    /// Mean luminance of the sky above the horizon, cd/m^2.
    pub mean_cd_m2: f64,
}

/// Azimuth of a direction in the axes of the horizon, rad.
pub(super) fn azimuth(local: DVec3) -> f64 {
    local.x.atan2(-local.z)
}

/// Direction towards a light, unit vector in world axes, and its illuminance, lx.
type Arriving = (DVec3, [f64; 3]);

/// Returns the illuminances that the sources of a scene cause at an eye outside of the air, lx, with their directions, brightest first. For an
/// eclipsed sun it also returns the sun's direction and the light that is scattered in from outside the shadow, lx, as if the sun were in the zenith.
fn sources(objects: &SceneObjects, eye_m: DVec3) -> (Vec<Arriving>, Option<Arriving>) {
    let suns = suns(objects);
    let body_light = |body: &Body| -> [f64; 3] {
        let offset_m = body.position_m - eye_m;
        let reflected = lights_on(body, &suns, eye_m).into_iter().map(|light| {
            let lx = reflected_lx(body, -offset_m, &light);
            let open = light
                .shadow
                .map_or([1.0; 3], |shadow| shadow.open_share_of_body(body.radii_m.max_element(), light.direction));
            [0, 1, 2].map(|c| lx[c] * open[c])
        });
        let emitted = suns.iter().filter(|_| body.emission.is_some()).find(|sun| sun.position_m == body.position_m);
        let emitted = emitted.and_then(|sun| sun.light_at(eye_m)).map(|light| light.illuminance_lx);
        reflected.chain(emitted).fold([0.0; 3], |sum, light| [0, 1, 2].map(|c| sum[c] + light[c]))
    };
    let outside = |body: &&Arc<Body>| (body.position_m - eye_m).length() > body.radii_m.max_element();
    let mut around: Option<Arriving> = None;
    let mut found: Vec<Arriving> = objects
        .bodies
        .iter()
        .filter(outside)
        .map(|body| {
            let offset_m = body.position_m - eye_m;
            let own_rad = body.angular_radius_rad(eye_m);
            let hidden: f64 = objects
                .bodies
                .iter()
                .filter(outside)
                .filter(|other| (other.position_m - eye_m).length() < offset_m.length())
                .map(|other| {
                    let apart = offset_m.angle_between(other.position_m - eye_m);
                    hidden_share(own_rad, other.angular_radius_rad(eye_m), apart)
                })
                .sum();
            let (light, open) = (body_light(body), (1.0 - hidden).max(0.0));
            if body.emission.is_some() && hidden > 0.0 {
                let share = LEAST_OF_ECLIPSED * (1.0 - open);
                let lit = light.map(|lx| lx * share);
                if around.is_none_or(|(_, brightest)| luminance(lit) > luminance(brightest)) {
                    around = Some((offset_m.normalize(), lit));
                }
            }
            (offset_m.normalize(), light.map(|lx| lx * open))
        })
        .filter(|(_, light)| luminance(*light) > 0.0)
        .collect();
    found.sort_by(|(_, a), (_, b)| luminance(*b).total_cmp(&luminance(*a)));
    found.truncate(MOST_SOURCES);
    (found, around)
}

impl SceneObjects {
    /// The local sky of a camera at the observer's place; `None` elsewhere, or without surroundings.
    pub fn local_sky(&self, camera_m: DVec3) -> Option<LocalSky> {
        let (surroundings, observer) = self.surroundings_at(camera_m)?;
        let horizon_from_world = horizon_from_world(observer, self.time_s);
        let (sources, around) = sources(self, observer.epoch.position_m);
        Some(LocalSky::new(surroundings, horizon_from_world, &sources, around))
    }

    /// The local sky of a camera, used only for starlight. The time is rounded to whole minutes, in which the sky rotates by 0.25 degrees.
    pub fn sky_of_stars(&self, camera_m: DVec3) -> Option<LocalSky> {
        let time_s = (self.time_s / STARS_S).round() * STARS_S;
        let (surroundings, observer) = self.surroundings_at(camera_m)?;
        Some(LocalSky::unlit(surroundings, horizon_from_world(observer, time_s)))
    }

    /// The refraction around a camera at the observer's place; `None` elsewhere, or without air.
    pub fn refraction(&self, camera_m: DVec3) -> Option<Refraction> {
        let (surroundings, observer) = self.surroundings_at(camera_m)?;
        let air = surroundings.refraction?;
        Some(Refraction { zenith: horizon_from_world(observer, self.time_s).row(1), density: air.density() })
    }

    /// Apparent position of an object relative to a camera, m, world axes: refracted if the camera is at the observer's
    /// place and the object is beyond the air.
    pub fn seen_m(&self, camera_m: DVec3, place_m: DVec3) -> DVec3 {
        let refraction = self.refraction(camera_m).filter(|_| place_m.length() > BEYOND_AIR_M);
        refraction.map_or(place_m, |refraction| refraction.seen(place_m))
    }

    /// The surroundings of a camera at the observer's place, and the observer.
    fn surroundings_at(&self, camera_m: DVec3) -> Option<(&Surroundings, &Observer)> {
        let observer = self.observer.as_ref()?;
        let is_on_ground = (camera_m - observer.epoch.position_m).length() <= ON_GROUND_M;
        self.surroundings.as_deref().filter(|_| is_on_ground).map(|surroundings| (surroundings, observer))
    }
}

/// Illuminance of a horizontal surface on a clear day with the sun at a sine of altitude, relative to that with the sun
/// in the zenith.
fn clear_day_factor(air: &Air, sine: f64) -> f64 {
    let altitude_rad = sine.clamp(-1.0, 1.0).asin();
    let sun_light = |sine: f64| sine.max(0.0) * luminance(air.transmission(sine.max(0.0)));
    let sky_lx = air.scattered.table(altitude_rad).level_lx(altitude_rad);
    (sun_light(sine) + sky_lx) * (1.0 - SKY_OF_HIGH_SUN) / sun_light(1.0)
}

fn horizon_from_world(observer: &Observer, time_s: f64) -> DMat3 {
    DMat3::from_quat(observer.icrs_from_horizon(time_s).inverse())
}

impl LocalSky {
    /// The sky around an observer with occlusion and extinction only, without its own light.
    fn unlit(surroundings: &Surroundings, horizon_from_world: DMat3) -> Self {
        Self {
            horizon_from_world,
            air: surroundings.air.clone(),
            refraction: surroundings
                .refraction
                .map(|air| Refraction { zenith: horizon_from_world.row(1), density: air.density() }),
            horizon: surroundings.ground.as_ref().map(|ground| ground.horizon.clone()),
            landscape: surroundings.ground.as_ref().and_then(|ground| ground.landscape.clone()),
            sources: Vec::new(),
            ground_cd_m2: [0.0; 3],
            white_cd_m2: [0.0; 3],
            mean_cd_m2: 0.0,
        }
    }

    /// The sky around an observer in the light of sources: unit vectors in world axes without air, and illuminances
    /// outside of the air, lx. `around` is the light scattered in around an eclipse: the direction of the eclipsed sun,
    /// and the illuminance of a horizontal surface if that sun were in the zenith, lx. It has the colours of a sky at
    /// sunset, and scales with the light of a clear day at the sun's altitude.
    pub fn new(
        surroundings: &Surroundings,
        horizon_from_world: DMat3,
        sources: &[Arriving],
        around: Option<Arriving>,
    ) -> Self {
        let sine = |direction: &DVec3| (horizon_from_world * *direction).y;
        let scattering_sources = surroundings.air.iter().flat_map(|air| {
            let least_cd_m2 = LEAST_OF_GLOW * luminance(air.glow_cd_m2);
            let bright_sources = sources.iter().map(|(direction, light)| {
                let altitude_rad = sine(direction).clamp(-1.0, 1.0).asin();
                SkySource { direction: *direction, light_lx: *light, table: air.scattered.table(altitude_rad) }
            });
            bright_sources
                .filter(move |source| luminance(source.light_lx) * source.table.brightest_cd_m2() > least_cd_m2)
        });
        let mut sky = Self::unlit(surroundings, horizon_from_world);
        let seen = |source: SkySource| SkySource { direction: sky.seen(source.direction), ..source };
        sky.sources = scattering_sources.map(seen).collect();
        if let Some((air, (direction, around_lx))) = surroundings.air.as_ref().zip(around) {
            let day = clear_day_factor(air, sine(&direction));
            let light_lx = around_lx.map(|lx| lx * day);
            if luminance(light_lx) > LEAST_OF_GLOW * luminance(air.glow_cd_m2) {
                let table = Arc::new(air.scattered.table(0.0).all_around(0.0));
                sky.sources.truncate(MOST_SOURCES - 1);
                sky.sources.push(SkySource { direction: sky.zenith(), light_lx, table });
            }
        }
        let (mean, mut lit_lx) = sky.summed();
        for (direction, light) in sources {
            let seen = sky.seen(*direction);
            let (passed, sine) = (sky.transmission(seen), sine(&seen).max(0.0));
            (0..3).for_each(|c| lit_lx[c] += light[c] * passed[c] * sine);
        }
        sky.mean_cd_m2 = mean;
        sky.white_cd_m2 = lit_lx.map(|lx| lx / PI);
        let albedo = surroundings.ground.as_ref().map_or(0.0, |ground| ground.albedo);
        sky.ground_cd_m2 = sky.white_cd_m2.map(|white| white * albedo);
        sky
    }

    /// Mean luminance of the sky, cd/m^2, and the illuminance of a horizontal surface, lx. Each node represents a ring
    /// of equal solid angle; the angles between sources and nodes are never small enough to matter.
    fn summed(&self) -> (f64, [f64; 3]) {
        let [rings, around] = NODES;
        let world_from_horizon = self.horizon_from_world.transpose();
        let (mut mean, mut lit) = (0.0, [0.0; 3]);
        for ring in 0..rings {
            let sine = (ring as f64 + 0.5) / rings as f64;
            for step in 0..around {
                let (sin, cos) = ((step as f64 + 0.5 * (ring % 2) as f64) / around as f64 * TAU).sin_cos();
                let across = (1.0 - sine * sine).sqrt();
                let light = self.scattered_cd_m2(world_from_horizon * DVec3::new(across * cos, sine, across * sin));
                let share = 1.0 / (rings * around) as f64;
                mean += luminance(light) * share;
                (0..3).for_each(|c| lit[c] += TAU * sine * light[c] * share);
            }
        }
        (mean, lit)
    }

    /// Apparent position of a distant object, from its position without air, at the same distance; world axes.
    pub fn seen(&self, without_air: DVec3) -> DVec3 {
        self.refraction.map_or(without_air, |refraction| refraction.seen(without_air))
    }

    /// Position without air of a distant object, from its apparent position, at the same distance.
    pub fn arriving(&self, seen: DVec3) -> DVec3 {
        self.refraction.map_or(seen, |refraction| refraction.arriving(seen))
    }

    /// The linear map from a distant body with an angular radius (rad) to its apparent position. It is the identity without refraction, and for
    /// objects within the air. The position is relative to the eye, m.
    pub fn seen_body(&self, place_m: DVec3, radius_rad: f64) -> DMat3 {
        let refraction = self.refraction.filter(|_| place_m.length() > BEYOND_AIR_M);
        refraction.map_or(DMat3::IDENTITY, |refraction| refraction.around(place_m, radius_rad))
    }

    /// Sine of the altitude of the highest ground; `None` without ground.
    pub fn highest_ground_sine(&self) -> Option<f64> {
        let horizon = self.horizon.as_ref()?;
        let highest_rad =
            self.landscape.as_ref().map_or_else(|| horizon.highest_rad(), |landscape| landscape.highest_rad());
        Some(highest_rad.sin())
    }

    /// Unit vector to the zenith, world axes.
    pub fn zenith(&self) -> DVec3 {
        self.horizon_from_world.row(1)
    }

    /// Sine of a direction's altitude, and sine of the horizon's altitude at its azimuth; unit vector, world axes.
    fn sines(&self, direction: DVec3) -> [f64; 2] {
        let local = self.horizon_from_world * direction;
        let at_horizon = match &self.horizon {
            Some(horizon) if !horizon.is_flat() => horizon.altitude_rad(azimuth(local)).sin(),
            Some(horizon) => horizon.level_rad.sin(),
            None => -2.0,
        };
        [local.y, at_horizon]
    }

    /// Whether the ground hides a direction, a unit vector in world axes.
    pub fn hides(&self, direction: DVec3) -> bool {
        let [sine, at_horizon] = self.sines(direction);
        sine < at_horizon
    }

    /// Fraction of the light from a direction that arrives: linear Rec. 709, 0 below the horizon.
    pub fn transmission(&self, direction: DVec3) -> [f64; 3] {
        let [sine, at_horizon] = self.sines(direction);
        if sine < at_horizon {
            return [0.0; 3];
        }
        self.through_air(sine)
    }

    /// Fraction of the light at an altitude, given by its sine, that passes the air. Without ground the sky below the horizon mirrors that
    /// above it.
    fn through_air(&self, sine: f64) -> [f64; 3] {
        let sine = if self.horizon.is_some() { sine } else { sine.abs() };
        self.air.as_ref().map_or([1.0; 3], |air| air.transmission(sine))
    }

    /// The same fraction for a disc with an angular radius, rad. It is computed for the middle of the part of the disc above the horizon.
    pub fn transmission_of_disc(&self, direction: DVec3, radius_rad: f64) -> [f64; 3] {
        let [sine, at_horizon] = self.sines(direction).map(|sine| sine.clamp(-1.0, 1.0).asin());
        let above = (sine + radius_rad).min(FRAC_PI_2);
        if self.horizon.is_some() && above < at_horizon {
            return [0.0; 3];
        }
        let lowest = if self.horizon.is_some() { (sine - radius_rad).max(at_horizon) } else { sine - radius_rad };
        self.through_air((0.5 * (above + lowest)).sin())
    }

    /// Share of a sun's disc that the Earth does not hide. The disc has an angular radius, rad, and an apparent direction; the Earth's horizon is
    /// `dip_rad` below altitude 0. If there is ground, it hides the disc pixel by pixel. Without ground, this share dims the whole disc of a setting
    /// sun, so that a sun below the horizon does not shine into the night.
    pub(super) fn risen_share(&self, direction: DVec3, radius_rad: f64, dip_rad: f64) -> f64 {
        if self.horizon.is_some() {
            return 1.0;
        }
        let altitude_rad = self.sines(direction)[0].clamp(-1.0, 1.0).asin();
        ((altitude_rad + dip_rad + radius_rad) / (2.0 * radius_rad)).clamp(0.0, 1.0)
    }

    /// Luminance of the light that the air scatters and emits in a direction above the horizon, cd/m^2.
    fn scattered_cd_m2(&self, direction: DVec3) -> [f64; 3] {
        let Some(air) = &self.air else { return [0.0; 3] };
        let local = self.horizon_from_world * direction;
        let (altitude_rad, azimuth_rad) = (local.y.clamp(-1.0, 1.0).asin(), azimuth(local));
        self.sources.iter().fold(air.glow(altitude_rad), |sum, source| {
            let apart_rad = azimuth_rad - azimuth(self.horizon_from_world * source.direction);
            let light = source.table.luminance(altitude_rad, apart_rad, direction.dot(source.direction));
            [0, 1, 2].map(|c| sum[c] + light[c] * source.light_lx[c])
        })
    }

    /// Apparent luminance of an object that has `shown_cd_m2` outside of the air, in a direction that the ground does not hide. It includes the light
    /// that the air adds.
    pub fn above_cd_m2(&self, direction: DVec3, shown_cd_m2: [f64; 3]) -> [f64; 3] {
        let sine = self.sines(direction)[0];
        let passed = self.through_air(sine);
        let added = self.scattered_cd_m2(direction);
        [0, 1, 2].map(|c| shown_cd_m2[c] * passed[c] + added[c])
    }

    /// Returns the luminance of the ground in a direction, multiplied by the hidden fraction, linear Rec. 709, cd/m^2; and that fraction.
    pub fn ground(&self, direction: DVec3) -> ([f64; 3], f64) {
        if let Some(landscape) = &self.landscape {
            let [r, g, b, share] = landscape.sample(self.horizon_from_world * direction);
            let reflected = [r, g, b];
            return ([0, 1, 2].map(|c| self.white_cd_m2[c] * reflected[c]), share);
        }
        if self.hides(direction) { (self.ground_cd_m2, 1.0) } else { ([0.0; 3], 0.0) }
    }

    /// Luminance of the sky or, below the horizon, of the ground in a direction, linear Rec. 709, cd/m^2.
    pub fn luminance_cd_m2(&self, direction: DVec3) -> [f64; 3] {
        if self.hides(direction) { self.ground_cd_m2 } else { self.scattered_cd_m2(direction) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surroundings(air: bool, points: Vec<[f64; 2]>) -> Surroundings {
        let ground = Ground { horizon: Horizon::new(points), albedo: 0.2, landscape: None };
        Surroundings { air: air.then(|| Air::new(0.2, 0.0, [1e-4; 3])), refraction: None, ground: Some(ground) }
    }

    #[test]
    fn a_line_of_hills_is_linear_between_its_points_and_wraps_around() {
        // Azimuth 2 pi closes the line, and a wall rises at one azimuth.
        let house = Horizon::new(vec![[0.0, 0.3], [1.5, 0.2], [1.5, 0.7], [2.0, 0.7], [TAU, 0.3]]);
        let expected = [(0.0, 0.3), (0.75, 0.25), (1.5 - 1e-9, 0.2), (1.5, 0.7), (1.75, 0.7), (TAU - 1e-9, 0.3)];
        for (azimuth, altitude) in expected {
            assert!(
                (house.altitude_rad(azimuth) - altitude).abs() < 1e-8,
                "{azimuth}: {}",
                house.altitude_rad(azimuth)
            );
        }
        let hills = Horizon::new(vec![[1.0, 0.1], [2.0, 0.3], [5.0, -0.1]]);
        for (azimuth, altitude) in [(1.0, 0.1), (1.5, 0.2), (2.0, 0.3), (3.5, 0.1), (5.0, -0.1), (1.0 + TAU, 0.1)] {
            assert!((hills.altitude_rad(azimuth) - altitude).abs() < 1e-12, "{azimuth}");
        }
        // From azimuth 5 through the north to azimuth 1: 2.283 rad.
        let north = -0.1 + 0.2 * (TAU - 5.0) / (TAU - 4.0);
        assert!((hills.altitude_rad(0.0) - north).abs() < 1e-12);
        assert!((f64::from(hills.sines()[0]) - north.sin()).abs() < 1e-7);
        assert_eq!(Horizon::default().altitude_rad(3.0), 0.0);
    }

    #[test]
    fn without_ground_the_sky_below_the_horizon_mirrors_that_above_but_the_sun_has_set() {
        let whole = Surroundings { ground: None, ..surroundings(true, Vec::new()) };
        let night = LocalSky::new(&whole, DMat3::IDENTITY, &[], None);
        let at = |degrees: f64| DVec3::new(0.0, degrees.to_radians().sin(), -degrees.to_radians().cos());
        for degrees in [20.0, 5.0, 1.0, 0.2] {
            let [above, below] = [degrees, -degrees].map(|degrees| night.transmission(at(degrees)));
            assert_eq!(above, below, "{degrees} degrees");
            let [above, below] = [degrees, -degrees].map(|degrees| night.transmission_of_disc(at(degrees), 1e-3));
            assert!((above[1] / below[1] - 1.0).abs() < 1e-9, "{degrees} degrees, disc");
        }
        // The profile has no black ring and no step at the horizon.
        let light = [20.0, 5.0, 1.0, 0.1, -0.1, -1.0, -5.0, -20.0].map(|degrees| night.luminance_cd_m2(at(degrees))[1]);
        assert!(light.iter().all(|light| *light > 3e-5), "{light:?}");
        assert!((light[3] / light[4] - 1.0).abs() < 0.05 && light[5] > 0.5 * light[2], "{light:?}");
        let risen = |degrees: f64| night.risen_share(at(degrees), 0.25_f64.to_radians(), 0.5_f64.to_radians());
        assert!(risen(0.0) == 1.0 && risen(-0.8) == 0.0 && (risen(-0.5) - 0.5).abs() < 1e-9);
        // Ground hides the sky below it, and the air above it is not mirrored.
        let grounded = LocalSky::new(&surroundings(true, vec![[0.0, -0.05]]), DMat3::IDENTITY, &[], None);
        assert_eq!(grounded.transmission(at(-20.0)), [0.0; 3]);
        assert_eq!(grounded.transmission(at(-2.0)), grounded.transmission(at(0.0)));
        assert!((grounded.risen_share(at(-20.0), 0.004, 0.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_ground_hides_the_sky_and_reflects_its_light() {
        let sun = (DVec3::new(0.0, 0.5, -0.75_f64.sqrt()), [1e5; 3]);
        let without_air = LocalSky::new(&surroundings(false, Vec::new()), DMat3::IDENTITY, &[sun], None);
        // 1e5 lx at 30 degrees on an albedo of 0.2.
        assert!((without_air.ground_cd_m2[1] / (5e4 * 0.2 / PI) - 1.0).abs() < 1e-9);
        assert_eq!(without_air.luminance_cd_m2(DVec3::Y), [0.0; 3]);
        assert_eq!(without_air.transmission(DVec3::NEG_Y), [0.0; 3]);
        assert_eq!(without_air.transmission(DVec3::new(1.0, 1e-3, 0.0)), [1.0; 3]);
        let in_air = LocalSky::new(&surroundings(true, Vec::new()), DMat3::IDENTITY, &[sun], None);
        // A clear sky gives a tenth to a third of the Sun's light.
        let sun_light = 5e4 * in_air.transmission(sun.0)[1] * 0.2 / PI;
        let sky_lx = in_air.ground_cd_m2[1] / sun_light - 1.0;
        assert!((0.1..0.4).contains(&sky_lx), "{sky_lx}");
        assert_eq!(in_air.luminance_cd_m2(DVec3::NEG_Y), in_air.ground_cd_m2);
        // A hill of 0.3 rad to the north (-z).
        let hill =
            LocalSky::new(&surroundings(true, vec![[0.0, 0.3], [0.5, 0.0], [5.7, 0.0]]), DMat3::IDENTITY, &[sun], None);
        let direction_at = |altitude: f64| DVec3::new(0.0, altitude.sin(), -altitude.cos());
        assert!(
            hill.hides(direction_at(0.29))
                && !hill.hides(direction_at(0.31))
                && !hill.hides(DVec3::new(0.0, 0.01, 1.0))
        );
    }
}
