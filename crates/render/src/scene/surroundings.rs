//! What is around an observer on the ground: the ground itself, up to the horizon, and the air.
//!
//! The ground hides what is below the horizon, which may be a line of hills; it reflects the light of the sky and of what stands in it as a Lambert surface, or a picture of it does (`landscape`). The air takes a part of the
//! light that comes through it, and scatters light of the sources in the sky ([`crate::photometry::atmosphere`]), and bends it ([`crate::observer::refraction`]): directions are those in which
//! something is seen, where they are not said to be those without air.

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
use crate::photometry::{
    atmosphere::{Air, measured_over_model},
    rec709::luminance,
    sky_light::SkyTable,
};

/// Sources whose light air scatters: the brightest ones.
pub const MOST_SOURCES: usize = 2;
/// A camera farther from the observer's place is not on the ground, m.
const ON_GROUND_M: f64 = 1000.0;
/// What air around an eclipse scatters into a total one, from all sides, of the Sun's light: 1 to 4 lx of 1e5 (S. M. Silverman and E. G. Mullen, Applied Optics 14, 2838, 1975).
const LEAST_OF_ECLIPSED: f64 = 2.7e-5;
/// Share that the sky has of the light of a clear day while the sun is high.
const SKY_OF_HIGH_SUN: f64 = 0.13;
/// What is nearer is seen where it is, m.
pub const BEYOND_AIR_M: f64 = 1e5;
/// What scatters less than this share of the air's own glow is left out, as the Sun is at night.
const LEAST_OF_GLOW: f64 = 1e-6;
/// What stars scatter in the eye is found anew for moments so far apart, s.
const STARS_S: f64 = 60.0;
/// Directions by which the light of the sky is summed: altitudes, and azimuths of each.
const NODES: [usize; 2] = [12, 16];

/// The line up to which the ground reaches: altitudes at azimuths, linear between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Horizon {
    /// Azimuth and altitude, rad; azimuths rise from 0 to below a turn. Empty: altitude 0 all around.
    points: Vec<[f64; 2]>,
}

/// Altitudes of a horizon that shaders read, evenly around it from the north on.
pub const HORIZON_STEPS: usize = 720;

impl Horizon {
    /// The line through points of azimuth and altitude, rad, whose azimuths rise from 0 to below a turn.
    pub fn new(points: Vec<[f64; 2]>) -> Self {
        Self { points }
    }

    /// Whether it is at altitude 0 all around.
    pub fn is_flat(&self) -> bool {
        self.points.is_empty()
    }

    /// Altitude at an azimuth, rad.
    pub fn altitude_rad(&self, azimuth_rad: f64) -> f64 {
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else { return 0.0 };
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
        self.points.iter().map(|[_, altitude_rad]| *altitude_rad).reduce(f64::max).unwrap_or(0.0)
    }

    /// Sines of its altitudes in [`HORIZON_STEPS`] steps.
    pub fn sines(&self) -> Vec<f32> {
        (0..HORIZON_STEPS)
            .map(|step| self.altitude_rad(step as f64 / HORIZON_STEPS as f64 * TAU).sin() as f32)
            .collect()
    }
}

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// The air; `None`: there is none.
    pub air: Option<Air>,
    /// What bends light; `None`: nothing.
    pub refraction: Option<RefractingAir>,
    /// The ground; `None`: one sees through it.
    pub ground: Option<Ground>,
}

/// The ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// Up to where it reaches.
    pub horizon: Horizon,
    /// What it reflects of light, 0 to 1.
    pub albedo: f64,
    /// A picture of it, up to whose line it reaches then.
    pub landscape: Option<Arc<Landscape>>,
}

/// A source of light in the sky.
#[derive(Clone, Debug, PartialEq)]
pub struct SkySource {
    /// Unit vector to where it is seen, world axes.
    pub direction: DVec3,
    /// What it gives outside of the air, as much as makes the sky as bright as was measured, linear Rec. 709, lx.
    pub light_lx: [f64; 3],
    /// What the sky shows of a source at its altitude.
    pub table: Arc<SkyTable>,
}

/// What is around an observer at a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalSky {
    /// Rows: east, zenith, south.
    pub horizon_from_world: DMat3,
    /// The air.
    pub air: Option<Air>,
    /// What bends light.
    pub refraction: Option<Refraction>,
    /// The horizon; `None`: there is no ground.
    pub horizon: Option<Horizon>,
    /// Sources whose light air scatters, at most [`MOST_SOURCES`].
    pub sources: Vec<SkySource>,
    /// The picture of the ground.
    pub landscape: Option<Arc<Landscape>>,
    /// Luminance of the ground, linear Rec. 709, cd/m^2.
    pub ground_cd_m2: [f64; 3],
    /// Luminance of a white level surface, the same.
    pub white_cd_m2: [f64; 3],
    /// Mean luminance of the sky above the horizon, cd/m^2.
    pub mean_cd_m2: f64,
}

/// Azimuth of a direction in the axes of the horizon, rad.
pub(super) fn azimuth(local: DVec3) -> f64 {
    local.x.atan2(-local.z)
}

/// The direction that light arrives from, unit vector in world axes, and how much of it, lx.
type Arriving = (DVec3, [f64; 3]);

/// What the sources of a scene give an eye outside of the air, the brightest first, directions and lx; and the direction of an eclipsed sun, and what comes in from where it is not hidden, lx, if it stood
/// in the zenith.
fn sources(objects: &SceneObjects, eye_m: DVec3) -> (Vec<Arriving>, Option<Arriving>) {
    let suns = suns(objects);
    let of_body = |body: &Body| -> [f64; 3] {
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
            let (light, open) = (of_body(body), (1.0 - hidden).max(0.0));
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
    /// What is around a camera that stands at the observer's place; `None` elsewhere, or where nothing is.
    pub fn local_sky(&self, camera_m: DVec3) -> Option<LocalSky> {
        let (surroundings, observer) = self.surroundings_at(camera_m)?;
        let horizon_from_world = horizon_from_world(observer, self.time_s);
        let (sources, around) = sources(self, observer.epoch.position_m);
        Some(LocalSky::new(surroundings, horizon_from_world, &sources, around))
    }

    /// What is around a camera for the light of stars alone, at the nearest of moments a minute apart: the sky turns by 0.25 degrees meanwhile.
    pub fn sky_of_stars(&self, camera_m: DVec3) -> Option<LocalSky> {
        let time_s = (self.time_s / STARS_S).round() * STARS_S;
        let (surroundings, observer) = self.surroundings_at(camera_m)?;
        Some(LocalSky::unlit(surroundings, horizon_from_world(observer, time_s)))
    }

    /// What bends light around a camera that stands at the observer's place; `None` elsewhere, or without air.
    pub fn refraction(&self, camera_m: DVec3) -> Option<Refraction> {
        let (surroundings, observer) = self.surroundings_at(camera_m)?;
        let air = surroundings.refraction?;
        Some(Refraction { zenith: horizon_from_world(observer, self.time_s).row(1), density: air.density() })
    }

    /// Where a camera sees what lies at a place relative to it, m, world axes: through the air of the observer's place, if it stands there and that lies beyond it.
    pub fn seen_m(&self, camera_m: DVec3, place_m: DVec3) -> DVec3 {
        let refraction = self.refraction(camera_m).filter(|_| place_m.length() > BEYOND_AIR_M);
        refraction.map_or(place_m, |refraction| refraction.seen(place_m))
    }

    /// The surroundings of a camera that stands at the observer's place, and the observer.
    fn surroundings_at(&self, camera_m: DVec3) -> Option<(&Surroundings, &Observer)> {
        let observer = self.observer.as_ref()?;
        let is_on_ground = (camera_m - observer.epoch.position_m).length() <= ON_GROUND_M;
        self.surroundings.as_deref().filter(|_| is_on_ground).map(|surroundings| (surroundings, observer))
    }
}

/// Light that a clear day gives a level surface with its sun at a sine of altitude, over that with the sun in the zenith.
fn of_clear_day(air: &Air, sine: f64) -> f64 {
    let altitude_rad = sine.clamp(-1.0, 1.0).asin();
    let of_sun = |sine: f64| sine.max(0.0) * luminance(air.transmission(sine.max(0.0)));
    let of_sky = air.scattered.table(altitude_rad).level_lx(altitude_rad);
    (of_sun(sine) + of_sky) * (1.0 - SKY_OF_HIGH_SUN) / of_sun(1.0)
}

fn horizon_from_world(observer: &Observer, time_s: f64) -> DMat3 {
    DMat3::from_quat(observer.icrs_from_horizon(time_s).inverse())
}

impl LocalSky {
    /// What is around an observer without any light: what it hides and takes.
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

    /// What is around an observer in the light of sources: unit vectors in world axes without air, and what they give outside of it, lx. What comes in from all around an eclipse, with the
    /// direction of the eclipsed sun, lx on a level surface if that were in the zenith, has the colours of a sky at sunset; it grows with the light of a clear day at the sun's altitude.
    pub fn new(
        surroundings: &Surroundings,
        horizon_from_world: DMat3,
        sources: &[Arriving],
        around: Option<Arriving>,
    ) -> Self {
        let sine = |direction: &DVec3| (horizon_from_world * *direction).y;
        let of_air = surroundings.air.iter().flat_map(|air| {
            let least_cd_m2 = LEAST_OF_GLOW * luminance(air.glow_cd_m2);
            let shown = sources.iter().map(|(direction, light)| {
                let altitude_rad = sine(direction).clamp(-1.0, 1.0).asin();
                SkySource {
                    direction: *direction,
                    light_lx: light.map(|lx| lx * measured_over_model(altitude_rad)),
                    table: air.scattered.table(altitude_rad),
                }
            });
            shown.filter(move |source| luminance(source.light_lx) * source.table.brightest_cd_m2() > least_cd_m2)
        });
        let mut sky = Self::unlit(surroundings, horizon_from_world);
        let seen = |source: SkySource| SkySource { direction: sky.seen(source.direction), ..source };
        sky.sources = of_air.map(seen).collect();
        if let Some((air, (direction, around_lx))) = surroundings.air.as_ref().zip(around) {
            let day = of_clear_day(air, sine(&direction));
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

    /// Mean luminance of the sky, cd/m^2, and what it gives a level surface, lx. A node stands for a ring of equal solid angle, and the angles between sources and nodes are never
    /// small enough to matter.
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

    /// Where one sees what lies far away in a direction without air, and as far away; world axes.
    pub fn seen(&self, without_air: DVec3) -> DVec3 {
        self.refraction.map_or(without_air, |refraction| refraction.seen(without_air))
    }

    /// Where what is seen in a direction lies without air, and as far away.
    pub fn arriving(&self, seen: DVec3) -> DVec3 {
        self.refraction.map_or(seen, |refraction| refraction.arriving(seen))
    }

    /// The linear map of a far body, an angle wide (rad), to where it is seen; without refraction, or of what is within the air, it changes nothing. Its place is relative to the eye, m.
    pub fn seen_body(&self, place_m: DVec3, radius_rad: f64) -> DMat3 {
        let refraction = self.refraction.filter(|_| place_m.length() > BEYOND_AIR_M);
        refraction.map_or(DMat3::IDENTITY, |refraction| refraction.around(place_m, radius_rad))
    }

    /// Sine of the altitude of the highest ground; `None`: there is none.
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

    /// Sine of a direction's altitude, and that of the horizon's below it; unit vector, world axes.
    fn sines(&self, direction: DVec3) -> [f64; 2] {
        let local = self.horizon_from_world * direction;
        let of_horizon = match &self.horizon {
            Some(horizon) if !horizon.is_flat() => horizon.altitude_rad(azimuth(local)).sin(),
            Some(_) => 0.0,
            None => -2.0,
        };
        [local.y, of_horizon]
    }

    /// Whether the ground hides what lies in a direction, a unit vector in world axes.
    pub fn hides(&self, direction: DVec3) -> bool {
        let [sine, of_horizon] = self.sines(direction);
        sine < of_horizon
    }

    /// Share of the light from a direction that arrives: linear Rec. 709, 0 from below the horizon.
    pub fn transmission(&self, direction: DVec3) -> [f64; 3] {
        let [sine, of_horizon] = self.sines(direction);
        if sine < of_horizon {
            return [0.0; 3];
        }
        self.air.as_ref().map_or([1.0; 3], |air| air.transmission(sine))
    }

    /// The same for a disc of an angular radius, rad: that of the middle of what stands above the horizon.
    pub fn transmission_of_disc(&self, direction: DVec3, radius_rad: f64) -> [f64; 3] {
        let [sine, of_horizon] = self.sines(direction).map(|sine| sine.clamp(-1.0, 1.0).asin());
        let above = (sine + radius_rad).min(FRAC_PI_2);
        if self.horizon.is_some() && above < of_horizon {
            return [0.0; 3];
        }
        let lowest = if self.horizon.is_some() { (sine - radius_rad).max(of_horizon) } else { sine - radius_rad };
        self.air.as_ref().map_or([1.0; 3], |air| air.transmission((0.5 * (above + lowest)).sin()))
    }

    /// Luminance of what the air scatters and gives off towards a direction above the horizon, cd/m^2.
    fn scattered_cd_m2(&self, direction: DVec3) -> [f64; 3] {
        let Some(air) = &self.air else { return [0.0; 3] };
        let local = self.horizon_from_world * direction;
        let (altitude_rad, azimuth_rad) = (local.y.clamp(0.0, 1.0).asin(), azimuth(local));
        self.sources.iter().fold(air.glow(local.y.max(0.0)), |sum, source| {
            let apart_rad = azimuth_rad - azimuth(self.horizon_from_world * source.direction);
            let light = source.table.luminance(altitude_rad, apart_rad, direction.dot(source.direction));
            [0, 1, 2].map(|c| sum[c] + light[c] * source.light_lx[c])
        })
    }

    /// Luminance of what shows `shown_cd_m2` outside of the air, in a direction that the ground does not hide, with what the air adds.
    pub fn above_cd_m2(&self, direction: DVec3, shown_cd_m2: [f64; 3]) -> [f64; 3] {
        let sine = self.sines(direction)[0];
        let passed = self.air.as_ref().map_or([1.0; 3], |air| air.transmission(sine));
        let added = self.scattered_cd_m2(direction);
        [0, 1, 2].map(|c| shown_cd_m2[c] * passed[c] + added[c])
    }

    /// Luminance of the ground in a direction times the share of it that is hidden, linear Rec. 709, cd/m^2, and that share.
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
    fn a_line_of_hills_is_straight_between_its_points_and_goes_round() {
        let hills = Horizon::new(vec![[1.0, 0.1], [2.0, 0.3], [5.0, -0.1]]);
        for (azimuth, altitude) in [(1.0, 0.1), (1.5, 0.2), (2.0, 0.3), (3.5, 0.1), (5.0, -0.1), (1.0 + TAU, 0.1)] {
            assert!((hills.altitude_rad(azimuth) - altitude).abs() < 1e-12, "{azimuth}");
        }
        // From 5 over the north to 1: 2.283 rad.
        let north = -0.1 + 0.2 * (TAU - 5.0) / (TAU - 4.0);
        assert!((hills.altitude_rad(0.0) - north).abs() < 1e-12);
        assert!((f64::from(hills.sines()[0]) - north.sin()).abs() < 1e-7);
        assert_eq!(Horizon::default().altitude_rad(3.0), 0.0);
    }

    #[test]
    fn the_ground_hides_and_shows_the_light_that_falls_on_it() {
        let sun = (DVec3::new(0.0, 0.5, -0.75_f64.sqrt()), [1e5; 3]);
        let without_air = LocalSky::new(&surroundings(false, Vec::new()), DMat3::IDENTITY, &[sun], None);
        // 1e5 lx at 30 degrees on an albedo of 0.2.
        assert!((without_air.ground_cd_m2[1] / (5e4 * 0.2 / PI) - 1.0).abs() < 1e-9);
        assert_eq!(without_air.luminance_cd_m2(DVec3::Y), [0.0; 3]);
        assert_eq!(without_air.transmission(DVec3::NEG_Y), [0.0; 3]);
        assert_eq!(without_air.transmission(DVec3::new(1.0, 1e-3, 0.0)), [1.0; 3]);
        let in_air = LocalSky::new(&surroundings(true, Vec::new()), DMat3::IDENTITY, &[sun], None);
        // A clear sky gives a tenth to a third of what the Sun does.
        let of_sun = 5e4 * in_air.transmission(sun.0)[1] * 0.2 / PI;
        let of_sky = in_air.ground_cd_m2[1] / of_sun - 1.0;
        assert!((0.1..0.4).contains(&of_sky), "{of_sky}");
        assert_eq!(in_air.luminance_cd_m2(DVec3::NEG_Y), in_air.ground_cd_m2);
        // To the north (-z) a hill of 0.3 rad.
        let hill =
            LocalSky::new(&surroundings(true, vec![[0.0, 0.3], [0.5, 0.0], [5.7, 0.0]]), DMat3::IDENTITY, &[sun], None);
        let at = |altitude: f64| DVec3::new(0.0, altitude.sin(), -altitude.cos());
        assert!(hill.hides(at(0.29)) && !hill.hides(at(0.31)) && !hill.hides(DVec3::new(0.0, 0.01, 1.0)));
    }
}
