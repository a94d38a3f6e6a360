//! The stars of a scene as its observer sees them while its time goes on.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
};

use super::SceneSnapshot;
use crate::{
    catalogue::{chunks::StarSet, epoch::seen_from},
    observer::Observer,
};

/// See the module. Without an observer stars stay as they are loaded.
#[derive(Debug)]
pub struct SeenStars {
    observer: Option<Observer>,
    /// As they were loaded: every other set is made from this one, so that a moment has the same stars whichever was before.
    loaded: Arc<StarSet>,
    /// The number of their vantage.
    first: i64,
    newest: Mutex<(i64, Arc<StarSet>)>,
    /// Another set is being made.
    is_busy: AtomicBool,
}

impl SeenStars {
    /// Stars that are loaded for the epoch of an observer.
    pub fn new(loaded: Arc<StarSet>, observer: Option<Observer>) -> Arc<Self> {
        let first = observer.map_or(0, |observer| Observer::vantage_number(observer.epoch_s));
        let newest = Mutex::new((first, Arc::clone(&loaded)));
        Arc::new(Self { observer, loaded, first, newest, is_busy: AtomicBool::new(false) })
    }

    /// The stars of a moment; where they have yet to be made, which takes a second for each few million, those of the moment before, and they are made meanwhile.
    pub fn at(self: &Arc<Self>, time_s: f64) -> Arc<StarSet> {
        let (number, stars) = self.newest();
        if self.observer.is_some()
            && number != Observer::vantage_number(time_s)
            && !self.is_busy.swap(true, Ordering::AcqRel)
        {
            let own = Arc::clone(self);
            let making = thread::Builder::new().name("stars".to_owned()).spawn(move || {
                drop(own.made(time_s));
                own.is_busy.store(false, Ordering::Release);
            });
            if let Err(error) = making {
                tracing::error!("stars stay as they were seen: {error}");
                self.is_busy.store(false, Ordering::Release);
            }
        }
        stars
    }

    /// The stars of a moment, which are waited for.
    pub fn made(&self, time_s: f64) -> Arc<StarSet> {
        let (number, stars) = self.newest();
        let wanted = Observer::vantage_number(time_s);
        let Some(observer) = self.observer.filter(|_| number != wanted) else { return stars };
        let stars = if wanted == self.first {
            Arc::clone(&self.loaded)
        } else {
            Arc::new(seen_from(&self.loaded, observer.vantage(time_s)))
        };
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = (wanted, Arc::clone(&stars));
        stars
    }

    /// A scene at another moment, with the stars that there are for it ([`SeenStars::at`]).
    pub fn scene_at(self: &Arc<Self>, scene: &SceneSnapshot, time_s: f64) -> SceneSnapshot {
        SceneSnapshot { stars: self.at(time_s), ..scene.at(time_s) }
    }

    fn newest(&self) -> (i64, Arc<StarSet>) {
        let newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
        (newest.0, Arc::clone(&newest.1))
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;
    use crate::{
        catalogue::bright::bright_stars,
        observer::{Clock, Place},
        units::{ARCSECOND_RAD, DAY_S},
    };

    #[test]
    fn stars_follow_the_moment_and_are_the_same_whichever_was_before() {
        let place = Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 0.0 };
        let observer = Observer::new(place, Clock::default(), 0.0);
        let epoch = observer.epoch.of_stars();
        let records = bright_stars(0.0).into_iter().map(|star| epoch.seen(star)).collect();
        let loaded = Arc::new(StarSet::from_records(records).of_epoch(epoch));
        let seen = SeenStars::new(Arc::clone(&loaded), Some(observer));
        assert!(Arc::ptr_eq(&seen.at(0.2 * DAY_S), &loaded));
        let half_a_year = seen.made(182.0 * DAY_S);
        // Sirius is seen 40 arcsec elsewhere at most, and by a good part of that.
        let sirius = |set: &StarSet| {
            set.named().iter().find(|star| star.name == "Sirius").map(|star| star.star.position).unwrap_or_default()
        };
        let shift_arcsec = sirius(&half_a_year).angle_between(sirius(&loaded)) / ARCSECOND_RAD;
        assert!((20.0..41.0).contains(&shift_arcsec), "{shift_arcsec}");
        seen.made(50.0 * DAY_S);
        assert_eq!(seen.made(182.0 * DAY_S).stars, half_a_year.stars);
        assert!(Arc::ptr_eq(&seen.made(0.1 * DAY_S), &loaded));
        seen.made(182.0 * DAY_S);
        // In the background: those of before meanwhile.
        let before = seen.at(300.0 * DAY_S);
        assert!(Arc::ptr_eq(&before, &seen.made(182.0 * DAY_S)) || seen.at(300.0 * DAY_S).epoch != before.epoch);
        let began = Instant::now();
        while seen.at(300.0 * DAY_S).epoch == before.epoch {
            assert!(began.elapsed() < Duration::from_secs(60), "they are never made");
            thread::sleep(Duration::from_millis(5));
        }
        let without = SeenStars::new(Arc::clone(&loaded), None);
        assert!(Arc::ptr_eq(&without.made(1e9), &loaded) && Arc::ptr_eq(&without.at(1e9), &loaded));
    }
}
