//! The time of the daemon. It never jumps, whatever happens to the clock of the machine.
//!
//! Scenes with a running clock, and poses that are waiting for their time, follow this time. Clients read and send times of the machine's clock, so
//! these times are converted when they arrive and when they leave.

use std::{
    fmt,
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant, SystemTime},
};

/// If the machine's clock changes by more than this relative to the daemon's time, it is considered to have been set.
const SET: Duration = Duration::from_millis(1);

/// Returns the time of the machine's clock.
type MachineClock = Arc<dyn Fn() -> SystemTime + Send + Sync>;

/// A time that starts at that of the machine's clock and then follows a monotonic clock. Clones share it.
#[derive(Clone)]
pub struct TimeSource {
    machine: MachineClock,
    start: Instant,
    started: SystemTime,
    lead: Arc<Mutex<Lead>>,
}

/// Time by which the machine's clock is ahead of the daemon's time.
#[derive(Clone, Copy, Debug)]
enum Lead {
    Ahead(Duration),
    Behind(Duration),
}

impl Lead {
    fn of(machine: SystemTime, now: SystemTime) -> Self {
        match machine.duration_since(now) {
            Ok(ahead) => Self::Ahead(ahead),
            Err(behind) => Self::Behind(behind.duration()),
        }
    }

    /// Whether another measurement differs from this one by more than the error of measurements.
    fn is_other(self, measured: Self) -> bool {
        let apart = match (self, measured) {
            (Self::Ahead(a), Self::Ahead(b)) | (Self::Behind(a), Self::Behind(b)) => a.abs_diff(b),
            (Self::Ahead(a), Self::Behind(b)) | (Self::Behind(a), Self::Ahead(b)) => a.saturating_add(b),
        };
        apart > SET
    }
}

impl Default for TimeSource {
    fn default() -> Self {
        Self::with_machine(SystemTime::now)
    }
}

impl fmt::Debug for TimeSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TimeSource").field("started", &self.started).finish_non_exhaustive()
    }
}

impl TimeSource {
    /// Starts with a replacement for the machine's clock that a test can set.
    pub fn with_machine(machine: impl Fn() -> SystemTime + Send + Sync + 'static) -> Self {
        let started = machine();
        let lead = Arc::new(Mutex::new(Lead::Ahead(Duration::ZERO)));
        Self { machine: Arc::new(machine), start: Instant::now(), started, lead }
    }

    /// Returns the daemon's time.
    pub fn now(&self) -> SystemTime {
        self.started + self.start.elapsed()
    }

    /// Returns the time of the machine's clock, which may be set.
    pub fn machine_now(&self) -> SystemTime {
        (self.machine)()
    }

    /// Returns a time of the daemon as the machine's clock shows it, for clients and people.
    pub fn told(&self, time: SystemTime) -> SystemTime {
        let told = match self.lead() {
            Lead::Ahead(ahead) => time.checked_add(ahead),
            Lead::Behind(behind) => time.checked_sub(behind),
        };
        told.unwrap_or(time)
    }

    /// Converts a time of the machine's clock to the daemon's time.
    pub fn heard(&self, time: SystemTime) -> SystemTime {
        let heard = match self.lead() {
            Lead::Ahead(ahead) => time.checked_sub(ahead),
            Lead::Behind(behind) => time.checked_add(behind),
        };
        heard.unwrap_or(time)
    }

    /// Measures by how much the machine's clock is ahead. A difference within the error of measurements changes nothing, so that equal times stay
    /// equal.
    fn lead(&self) -> Lead {
        let measured = Lead::of(self.machine_now(), self.now());
        let mut lead = self.lead.lock().unwrap_or_else(PoisonError::into_inner);
        if lead.is_other(measured) {
            *lead = measured;
        }
        *lead
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicI64, Ordering::SeqCst};

    use super::*;

    #[test]
    fn time_goes_on_when_the_clock_of_the_machine_is_set() {
        let set_s = Arc::new(AtomicI64::new(0));
        let begin = SystemTime::now();
        let machine = {
            let set_s = Arc::clone(&set_s);
            move || match set_s.load(SeqCst) {
                ahead if ahead >= 0 => begin + Duration::from_secs(ahead.unsigned_abs()),
                behind => begin - Duration::from_secs(behind.unsigned_abs()),
            }
        };
        let time = TimeSource::with_machine(machine);
        let mut last = time.now();
        for offset_s in [-3600, 7200, -2, 0] {
            set_s.store(offset_s, SeqCst);
            let now = time.now();
            assert!(now >= last && now.duration_since(last).is_ok_and(|gone| gone < Duration::from_secs(1000)));
            last = now;
            // Times that clients send by the machine's clock must mean the same moment, and clients must get times of that clock.
            let sent = time.machine_now();
            let apart = |a: SystemTime, b: SystemTime| {
                a.duration_since(b).unwrap_or_else(|error| error.duration()).as_secs_f64()
            };
            assert!(apart(time.heard(sent), time.now()) < 1.0, "{offset_s}");
            assert!(apart(time.told(time.now()), sent) < 1.0, "{offset_s}");
            assert_eq!(time.heard(sent), time.heard(sent), "equal times stay equal");
        }
    }
}
