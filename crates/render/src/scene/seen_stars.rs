//! The stars of a scene while its time goes on: where their own motion has brought them, as its observer sees them.

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
    },
    observer::{Moment, Observer, Place},
    units::JULIAN_YEAR_S,
};

/// Within so many years of those for which they were loaded stars stay: the fastest moves by 10 arcsec a year, of those that the naked eye sees 98 % by less than 0.5.
const LOADED_YEARS: f64 = 0.5;

/// See [`rounded`], rad.
const PLACE_RAD: f64 = 5.0 * PI / 180.0;

/// Which stars a moment has.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    /// Julian years from J2000.0, by which they have moved on.
    years: f64,
    /// About where the observer is, and the number of the vantage; `None`: nobody looks.
    vantage: Option<(Place, i64)>,
}

/// See the module.
#[derive(Debug)]
pub struct SeenStars {
    /// As they were loaded: a moment near that of the loading has the same stars whichever was before.
    loaded: Arc<StarSet>,
    /// Which moment's they are.
    first: Seen,
    /// From where they are loaded for years that are far from that; empty: they do not move on by themselves.
    sources: Vec<StarSource>,
    held: Mutex<Held>,
    /// Another set is being made.
    is_busy: AtomicBool,
}

#[derive(Debug)]
struct Held {
    newest: (Seen, Arc<StarSet>),
    /// Those that were loaded for other years, from which all of these years are made.
    of_years: Option<Arc<StarSet>>,
    /// Years for which they could not be loaded: they are not tried again before others.
    failed_years: Option<f64>,
}

/// A place to 5 degrees: the rotation of the Earth shifts stars by 0.32 arcsec at most, by 0.03 from one such place to the next. Who moves on continuously has new stars every few hundred kilometres.
fn rounded(place: Place) -> Place {
    let step = |angle: f64| (angle / PLACE_RAD).round() * PLACE_RAD;
    Place { latitude_rad: step(place.latitude_rad), longitude_rad: step(place.longitude_rad), height_m: 0.0 }
}

impl SeenStars {
    /// Stars that are loaded from sources, for the epoch of an observer.
    pub fn new(loaded: Arc<StarSet>, observer: Option<&Observer>, sources: Vec<StarSource>) -> Arc<Self> {
        let vantage = observer.map(|observer| (rounded(observer.place), Observer::vantage_number(observer.epoch_s)));
        let first = Seen { years: loaded.epoch.years, vantage };
        let sources = if sources.iter().any(StarSource::may_move) { sources } else { Vec::new() };
        let held = Mutex::new(Held { newest: (first, Arc::clone(&loaded)), of_years: None, failed_years: None });
        Arc::new(Self { loaded, first, sources, held, is_busy: AtomicBool::new(false) })
    }

    /// The stars that an observer sees at a moment; where they have yet to be made, which takes a second for each few million, those of the moment before, and they are made meanwhile.
    pub fn at(self: &Arc<Self>, observer: Option<&Observer>, time_s: f64) -> Arc<StarSet> {
        let wanted = self.seen(observer, time_s);
        let ((of, stars), failed_years) = {
            let held = self.held();
            (held.newest.clone(), held.failed_years)
        };
        let is_hopeless = failed_years == Some(wanted.years);
        if of != wanted && !is_hopeless && !self.is_busy.swap(true, Ordering::AcqRel) {
            let (own, observer) = (Arc::clone(self), observer.copied());
            let making = thread::Builder::new().name("stars".to_owned()).spawn(move || {
                if let Err(error) = own.made(observer.as_ref(), time_s) {
                    own.held().failed_years = Some(wanted.years);
                    tracing::error!("stars stay as they were seen: {error}");
                }
                own.is_busy.store(false, Ordering::Release);
            });
            if let Err(error) = making {
                tracing::error!("stars stay as they were seen: {error}");
                self.is_busy.store(false, Ordering::Release);
            }
        }
        stars
    }

    /// The stars that an observer sees at a moment, which are waited for. Errors: a catalogue that cannot be read any more.
    pub fn made(&self, observer: Option<&Observer>, time_s: f64) -> Result<Arc<StarSet>, LoadError> {
        let wanted = self.seen(observer, time_s);
        let (of, stars) = self.held().newest.clone();
        if of == wanted {
            return Ok(stars);
        }
        let stars = if wanted == self.first {
            Arc::clone(&self.loaded)
        } else {
            let moved = self.moved(wanted.years)?;
            match observer {
                Some(observer) => Arc::new(seen_from(&moved, observer.vantage(time_s))),
                None => moved,
            }
        };
        self.held().newest = (wanted, Arc::clone(&stars));
        Ok(stars)
    }

    /// A scene at another moment, with the stars that there are for it ([`SeenStars::at`]).
    pub fn scene_at(self: &Arc<Self>, scene: &SceneSnapshot, time_s: f64) -> SceneSnapshot {
        SceneSnapshot { stars: self.at(scene.objects.observer.as_ref(), time_s), ..scene.at(time_s) }
    }

    /// Which stars a moment has.
    fn seen(&self, observer: Option<&Observer>, time_s: f64) -> Seen {
        let years = Moment::new(time_s, None).tdb_s() / JULIAN_YEAR_S;
        let stay = self.sources.is_empty() || (years - self.first.years).abs() <= LOADED_YEARS;
        Seen {
            years: if stay { self.first.years } else { years.round() },
            vantage: observer.map(|observer| (rounded(observer.place), Observer::vantage_number(time_s))),
        }
    }

    /// The stars where their own motion has brought them, from where those are seen that were loaded.
    fn moved(&self, years: f64) -> Result<Arc<StarSet>, LoadError> {
        if years == self.first.years {
            self.held().of_years = None;
            return Ok(Arc::clone(&self.loaded));
        }
        let known = self.held().of_years.clone().filter(|set| set.epoch.years == years);
        if let Some(known) = known {
            return Ok(known);
        }
        let (set, _) = load_stars(&self.sources, &Epoch { years, ..self.loaded.epoch }, &mut |_| {})?;
        // What is smooth over degrees stays, and all that was made for it.
        let set = Arc::new(set.with_unresolved(self.loaded.unresolved.clone()));
        self.held().of_years = Some(Arc::clone(&set));
        Ok(set)
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;
    use crate::{
        catalogue::{bright::bright_stars, galaxy::GalaxyParameters},
        observer::Clock,
        units::{ARCSECOND_RAD, DAY_S},
    };

    #[test]
    fn stars_follow_the_moment_and_are_the_same_whichever_was_before() {
        let place = Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 0.0 };
        let observer = Observer::new(place, Clock::default(), 0.0);
        let epoch = observer.epoch.of_stars();
        let records = bright_stars(0.0).into_iter().map(|star| epoch.seen(star)).collect();
        let loaded = Arc::new(StarSet::from_records(records).of_epoch(epoch));
        let stars = SeenStars::new(Arc::clone(&loaded), Some(&observer), Vec::new());
        let made = |time_s: f64| stars.made(Some(&observer), time_s).unwrap();
        let at = |time_s: f64| stars.at(Some(&observer), time_s);
        assert!(Arc::ptr_eq(&at(0.2 * DAY_S), &loaded));
        let half_a_year = made(182.0 * DAY_S);
        // Sirius is seen 40 arcsec elsewhere at most, and by a good part of that.
        let sirius = |set: &StarSet| {
            set.named().iter().find(|star| star.name == "Sirius").map(|star| star.star.position).unwrap_or_default()
        };
        let shift_arcsec = sirius(&half_a_year).angle_between(sirius(&loaded)) / ARCSECOND_RAD;
        assert!((20.0..41.0).contains(&shift_arcsec), "{shift_arcsec}");
        made(50.0 * DAY_S);
        assert_eq!(made(182.0 * DAY_S).stars, half_a_year.stars);
        assert!(Arc::ptr_eq(&made(0.1 * DAY_S), &loaded));
        made(182.0 * DAY_S);
        // In the background: those of before meanwhile.
        let before = at(300.0 * DAY_S);
        assert!(Arc::ptr_eq(&before, &made(182.0 * DAY_S)) || at(300.0 * DAY_S).epoch != before.epoch);
        let began = Instant::now();
        while at(300.0 * DAY_S).epoch == before.epoch {
            assert!(began.elapsed() < Duration::from_secs(60), "they are never made");
            thread::sleep(Duration::from_millis(5));
        }
        let galaxy = GalaxyParameters { stars: 9, seed: 1, fainter_than: None, unresolved_light: false };
        let without = SeenStars::new(Arc::clone(&loaded), None, vec![StarSource::Galaxy(galaxy)]);
        assert!(Arc::ptr_eq(&without.made(None, 1e12).unwrap(), &loaded));
        assert!(Arc::ptr_eq(&without.at(None, 1e12), &loaded));
        // On the other side of the Earth: by the rotation of both places, 0.46 km/s each.
        let elsewhere = observer.moved(Place { longitude_rad: place.longitude_rad + PI, ..place }, observer.clock);
        let shift = sirius(&stars.made(Some(&elsewhere), 0.0).unwrap()).angle_between(sirius(&loaded));
        assert!((0.05..0.65).contains(&(shift / ARCSECOND_RAD)), "{shift}");
    }

    #[test]
    fn stars_move_on_by_themselves_where_their_sources_have_a_motion() {
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
            // 2.279 arcsec a year.
            let moved_arcsec = arcturus(set).angle_between(arcturus(&loaded)) / ARCSECOND_RAD;
            assert!((moved_arcsec - 227.9).abs() < 0.5, "{moved_arcsec}");
            assert_eq!(set.stars.len(), loaded.stars.len());
        }
        assert!(arcturus(&later).angle_between(arcturus(&before)) > 450.0 * ARCSECOND_RAD);
        assert_eq!(stars.made(None, century_s).unwrap().stars, later.stars);
        // A catalogue that has gone meanwhile.
        let gone = vec![StarSource::File("/nowhere/stars.csv".into())];
        let gone = SeenStars::new(Arc::clone(&loaded), None, gone);
        assert!(gone.made(None, century_s).unwrap_err().to_string().contains("/nowhere/stars.csv"));
        assert!(Arc::ptr_eq(&gone.at(None, century_s), &loaded));
    }
}
