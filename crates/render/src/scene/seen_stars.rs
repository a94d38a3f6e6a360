//! The stars of a running scene: applies proper motion, the observer's aberration and the ephemerides of variable stars for each moment.

use std::{
    f64::consts::PI,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
};

use super::{
    SceneSnapshot,
    loader::{LoadError, StarSource, load_stars},
};
use crate::{
    catalogue::{
        chunks::StarSet,
        epoch::{Epoch, seen_from},
        variable,
    },
    observer::{Moment, Observer, Place},
    units::JULIAN_YEAR_S,
};

/// Stars are not updated within this number of years of the loaded epoch. The fastest star moves by 10 arcsec per year, and 98 % of the naked-eye
/// stars move by less than 0.5 arcsec per year.
const LOADED_YEARS: f64 = 0.5;

/// Step of [`rounded`], rad.
const PLACE_RAD: f64 = 5.0 * PI / 180.0;

/// Identifies the star set of a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct StarSetKey {
    /// Julian years from J2000.0 of the proper motion.
    years: f64,
    /// Rounded place of the observer and the index of the vantage point; `None`: no observer.
    vantage: Option<(Place, i64)>,
    /// Rounded brightness of the variable stars; `None`: they keep the brightness of the table.
    variable: Option<[i16; variable::COUNT]>,
}

/// Star sets by moment; see the module.
#[derive(Debug)]
pub struct SeenStars {
    /// The loaded set. Moments near that of loading use it, so that results do not depend on the moments shown before.
    loaded: Arc<StarSet>,
    /// Moment of the loaded set.
    first: StarSetKey,
    /// Sources for reloading at distant epochs; empty: no proper motion.
    sources: Vec<StarSource>,
    held: Mutex<Held>,
    /// Another set is being made in the background.
    is_busy: AtomicBool,
}

#[derive(Debug)]
struct Held {
    newest: (StarSetKey, Arc<StarSet>),
    /// Set that was reloaded for another epoch. All sets of that epoch are made from it.
    for_years: Option<Arc<StarSet>>,
    /// Epoch for which reloading failed; it is not retried before another epoch.
    failed_years: Option<f64>,
}

/// Julian years from J2000.0 to a moment of the scene.
fn julian_years(time_s: f64) -> f64 {
    Moment::new(time_s, None).tdb_s() / JULIAN_YEAR_S
}

/// Rounds a place to 5 degrees. The rotation of the Earth shifts stars by at most 0.32 arcsec, and this shift differs by 0.03 arcsec between
/// neighbouring rounded places. For an observer who moves continuously, the stars are made again every few hundred kilometres.
fn rounded(place: Place) -> Place {
    let step = |angle: f64| (angle / PLACE_RAD).round() * PLACE_RAD;
    Place { latitude_rad: step(place.latitude_rad), longitude_rad: step(place.longitude_rad), height_m: 0.0 }
}

impl SeenStars {
    /// Stars loaded from sources, for the epoch of an observer.
    pub fn new(loaded: Arc<StarSet>, observer: Option<&Observer>, sources: Vec<StarSource>) -> Arc<Self> {
        let vantage = observer.map(|observer| (rounded(observer.place), Observer::vantage_number(observer.epoch_s)));
        let years = loaded.epoch.years;
        let variable = sources.contains(&StarSource::BrightVariable).then(|| variable::steps(years));
        let first = StarSetKey { years, vantage, variable };
        let sources = if sources.iter().any(StarSource::may_move) { sources } else { Vec::new() };
        let held = Mutex::new(Held { newest: (first, Arc::clone(&loaded)), for_years: None, failed_years: None });
        Arc::new(Self { loaded, first, sources, held, is_busy: AtomicBool::new(false) })
    }

    /// Returns the stars that an observer sees at a moment. If this set does not exist yet, it is made in the background, which takes a second for a
    /// few million stars, and the previous set is returned.
    pub fn at(self: &Arc<Self>, observer: Option<&Observer>, time_s: f64) -> Arc<StarSet> {
        let wanted = self.key(observer, time_s);
        let ((newest, stars), failed_years) = {
            let held = self.held();
            (held.newest.clone(), held.failed_years)
        };
        let is_hopeless = failed_years == Some(wanted.years);
        if newest != wanted && !is_hopeless && !self.is_busy.swap(true, Ordering::AcqRel) {
            let (own, observer) = (Arc::clone(self), observer.copied());
            let making = thread::Builder::new().name("stars".to_owned()).spawn(move || {
                if let Err(error) = own.made(observer.as_ref(), time_s) {
                    own.held().failed_years = Some(wanted.years);
                    tracing::error!("cannot update the stars, keeping the previous ones: {error}");
                }
                own.is_busy.store(false, Ordering::Release);
            });
            if let Err(error) = making {
                tracing::error!("cannot update the stars, keeping the previous ones: {error}");
                self.is_busy.store(false, Ordering::Release);
            }
        }
        stars
    }

    /// Returns the stars that an observer sees at a moment, and blocks until they are made. Fails if a catalogue can no longer be read.
    pub fn made(&self, observer: Option<&Observer>, time_s: f64) -> Result<Arc<StarSet>, LoadError> {
        let wanted = self.key(observer, time_s);
        let (newest, stars) = self.held().newest.clone();
        if newest == wanted {
            return Ok(stars);
        }
        let stars = if wanted == self.first {
            Arc::clone(&self.loaded)
        } else {
            let mut moved = self.moved(wanted.years)?;
            if wanted.variable.is_some() {
                moved = Arc::new(moved.with_variable_stars(julian_years(time_s)));
            }
            match observer {
                Some(observer) => Arc::new(seen_from(&moved, observer.vantage(time_s))),
                None => moved,
            }
        };
        self.held().newest = (wanted, Arc::clone(&stars));
        Ok(stars)
    }

    /// A scene at another moment, with the currently available stars ([`SeenStars::at`]).
    pub fn scene_at(self: &Arc<Self>, scene: &SceneSnapshot, time_s: f64) -> SceneSnapshot {
        SceneSnapshot { stars: self.at(scene.objects.observer.as_ref(), time_s), ..scene.at(time_s) }
    }

    /// Identifies the star set of a moment.
    fn key(&self, observer: Option<&Observer>, time_s: f64) -> StarSetKey {
        let years = julian_years(time_s);
        let stay = self.sources.is_empty() || (years - self.first.years).abs() <= LOADED_YEARS;
        StarSetKey {
            years: if stay { self.first.years } else { years.round() },
            vantage: observer.map(|observer| (rounded(observer.place), Observer::vantage_number(time_s))),
            variable: self.first.variable.map(|_| variable::steps(years)),
        }
    }

    /// The stars with their proper motion applied, as seen from the reference point of loading.
    fn moved(&self, years: f64) -> Result<Arc<StarSet>, LoadError> {
        if years == self.first.years {
            self.held().for_years = None;
            return Ok(Arc::clone(&self.loaded));
        }
        let known = self.held().for_years.clone().filter(|set| set.epoch.years == years);
        if let Some(known) = known {
            return Ok(known);
        }
        let (set, _) = load_stars(&self.sources, &Epoch { years, ..self.loaded.epoch }, &mut |_| {})?;
        // Light that is smooth over degrees is not computed again, and neither is anything derived from it.
        let deep = self.loaded.deep.as_ref().map(|deep| Arc::new(deep.at_epoch(&set.epoch)));
        let set = Arc::new(set.with_unresolved(self.loaded.unresolved.clone()).with_deep(deep));
        self.held().for_years = Some(Arc::clone(&set));
        Ok(set)
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;
    use crate::{
        catalogue::{bright::bright_stars, galaxy::GalaxyParameters},
        observer::Clock,
        units::{ARCSECOND_RAD, DAY_S},
    };

    #[test]
    fn stars_depend_on_the_moment_and_not_on_earlier_moments() {
        let place = Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 0.0 };
        let observer = Observer::new(place, Clock::default(), 0.0);
        let epoch = observer.epoch.of_stars();
        let records = bright_stars(0.0).into_iter().map(|star| epoch.seen(star)).collect();
        let loaded = Arc::new(StarSet::from_records(records).of_epoch(epoch));
        let stars = SeenStars::new(Arc::clone(&loaded), Some(&observer), Vec::new());
        let made = |time_s: f64| stars.made(Some(&observer), time_s).unwrap();
        let stars_at = |time_s: f64| stars.at(Some(&observer), time_s);
        assert!(Arc::ptr_eq(&stars_at(0.2 * DAY_S), &loaded));
        let half_a_year = made(182.0 * DAY_S);
        // Sirius is displaced by at most 40 arcsec, and by a large part of that.
        let sirius = |set: &StarSet| {
            set.named().iter().find(|star| star.name == "Sirius").map(|star| star.star.position).unwrap_or_default()
        };
        let shift_arcsec = sirius(&half_a_year).angle_between(sirius(&loaded)) / ARCSECOND_RAD;
        assert!((20.0..41.0).contains(&shift_arcsec), "{shift_arcsec}");
        made(50.0 * DAY_S);
        assert_eq!(made(182.0 * DAY_S).stars, half_a_year.stars);
        assert!(Arc::ptr_eq(&made(0.1 * DAY_S), &loaded));
        made(182.0 * DAY_S);
        // Made in the background: the previous set is returned meanwhile.
        let before = stars_at(300.0 * DAY_S);
        assert!(Arc::ptr_eq(&before, &made(182.0 * DAY_S)) || stars_at(300.0 * DAY_S).epoch != before.epoch);
        let began = Instant::now();
        while stars_at(300.0 * DAY_S).epoch == before.epoch {
            assert!(began.elapsed() < Duration::from_secs(60), "the set is never made");
            thread::sleep(Duration::from_millis(5));
        }
        let galaxy = GalaxyParameters { stars: 9, seed: 1, fainter_than: None, unresolved_light: false };
        let without = SeenStars::new(Arc::clone(&loaded), None, vec![StarSource::Galaxy(galaxy)]);
        assert!(Arc::ptr_eq(&without.made(None, 1e12).unwrap(), &loaded));
        assert!(Arc::ptr_eq(&without.at(None, 1e12), &loaded));
        // Seen from the other side of the Earth, the star is displaced: the rotation of the Earth moves both places at 0.46 km/s, in opposite
        // directions.
        let elsewhere = observer.moved(Place { longitude_rad: place.longitude_rad + PI, ..place }, observer.clock);
        let shift = sirius(&stars.made(Some(&elsewhere), 0.0).unwrap()).angle_between(sirius(&loaded));
        assert!((0.05..0.65).contains(&(shift / ARCSECOND_RAD)), "{shift}");
    }

    #[test]
    fn variable_stars_follow_the_clock_and_not_earlier_moments() {
        let sources = vec![StarSource::BrightVariable];
        // Noon of 2022-09-17; Algol was faintest on the 18th at 1:31.
        let noon_s = 716_688_000.0;
        let observer =
            Observer::new(Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 0.0 }, Clock::default(), noon_s);
        let (loaded, report) = load_stars(&sources, &observer.epoch.of_stars(), &mut |_| {}).unwrap();
        assert_eq!((report.catalogues[0].stars, loaded.stars.len()), (9096, 9096));
        let stars = SeenStars::new(Arc::new(loaded), Some(&observer), sources);
        let v_of = |set: &StarSet, name: &str| {
            let named = set.named().iter().find(|star| star.name == name).unwrap().star;
            // The star itself is drawn with the same brightness.
            let drawn = set.iter().find(|(place, _, _)| place.angle_between(named.position) < 1e-7).unwrap().2;
            let v = named.apparent_magnitude();
            let drawn_lx = drawn.illuminance_at_1_pc_lx() / named.position.length_squared();
            assert!((crate::units::magnitude_from_illuminance_lx(drawn_lx) - v).abs() < 0.02, "{name}");
            v
        };
        let made = |hours: f64| stars.made(Some(&observer), noon_s + 3600.0 * hours).unwrap();
        let faint = made(13.52);
        assert!((v_of(&faint, "Algol") - 3.39).abs() < 0.03, "{}", v_of(&faint, "Algol"));
        assert_eq!(faint.stars.len(), 9096);
        let bright = made(19.0);
        assert!((v_of(&bright, "Algol") - 2.12).abs() < 0.03, "{}", v_of(&bright, "Algol"));
        assert!((v_of(&bright, "Vega") - v_of(&faint, "Vega")).abs() < 1e-3);
        assert_eq!(made(13.52).stars, faint.stars, "the same whatever was shown before");
        // Within a step the same set is used.
        assert!(Arc::ptr_eq(&made(13.521), &made(13.52)));
        let century = stars.made(Some(&observer), noon_s + 100.0 * JULIAN_YEAR_S).unwrap();
        assert_eq!(century.stars.len(), 9096);
        // Without the option Algol keeps the brightness of the table.
        let plain = load_stars(&[StarSource::Bright], &observer.epoch.of_stars(), &mut |_| {}).unwrap().0;
        assert!((v_of(&plain, "Algol") - 2.12).abs() < 1e-3);
    }

    #[test]
    fn stars_move_if_their_sources_have_proper_motion() {
        let century_s = 100.0 * JULIAN_YEAR_S;
        let sources = vec![StarSource::Bright];
        let (loaded, _) = load_stars(&sources, &Epoch::default(), &mut |_| {}).unwrap();
        let loaded = Arc::new(loaded);
        let stars = SeenStars::new(Arc::clone(&loaded), None, sources);
        let arcturus = |set: &StarSet| {
            set.named().iter().find(|star| star.name == "Arcturus").map(|star| star.star.position).unwrap_or_default()
        };
        assert!(Arc::ptr_eq(&stars.made(None, 0.4 * JULIAN_YEAR_S).unwrap(), &loaded));
        let [later, before] = [1.0, -1.0].map(|sign| stars.made(None, sign * century_s).unwrap());
        for set in [&later, &before] {
            // Proper motion of Arcturus: 2.279 arcsec per year.
            let moved_arcsec = arcturus(set).angle_between(arcturus(&loaded)) / ARCSECOND_RAD;
            assert!((moved_arcsec - 227.9).abs() < 0.5, "{moved_arcsec}");
            assert_eq!(set.stars.len(), loaded.stars.len());
        }
        assert!(arcturus(&later).angle_between(arcturus(&before)) > 450.0 * ARCSECOND_RAD);
        assert_eq!(stars.made(None, century_s).unwrap().stars, later.stars);
        // A catalogue that was deleted meanwhile.
        let deleted = vec![StarSource::File("/nowhere/stars.csv".into())];
        let deleted = SeenStars::new(Arc::clone(&loaded), None, deleted);
        assert!(deleted.made(None, century_s).unwrap_err().to_string().contains("/nowhere/stars.csv"));
        assert!(Arc::ptr_eq(&deleted.at(None, century_s), &loaded));
    }
}
