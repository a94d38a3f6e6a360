//! Who is connected, and what each connection may take of what all share: places among those who wait for frames and encoders, and bytes.

use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex, MutexGuard, OnceLock, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::Status;

use super::{
    access::{Digest, Moves},
    refusals,
};

/// Calls of RenderFrame of one client at the same time.
const RENDERS: usize = 4;
/// Frames of one client that are encoded, or wait for an encoder of their own kind, at the same time.
const ENCODINGS: usize = 2;
/// Frames of one client that take long to encode, at the same time.
const SLOW_ENCODINGS: usize = 1;
/// Bytes are counted in units of this.
const UNIT: u64 = 1024;
/// Bytes of requests that are not complete: of one client, and in all.
const INPUT_OF_ONE: u64 = 16 << 20;
const INPUT: u64 = 64 << 20;
/// Bytes of frames that are on their way: of one client, and in all. A frame that is larger than the share of one client is let through where
/// that client has no other.
const OUTPUT_OF_ONE: u64 = 512 << 20;
const OUTPUT: u64 = 1 << 30;

/// A connection without any call ends after this time.
const FIRST_CALL: Duration = Duration::from_secs(10);
/// A connection whose client does not read what it has asked for ends after this time.
const STALLED: Duration = Duration::from_secs(60);
/// A connection without calls on which nothing comes ends after this time. HTTP/2 clients answer pings meanwhile.
const IDLE: Duration = Duration::from_secs(120);

fn units(bytes: u64) -> u32 {
    u32::try_from(bytes.div_ceil(UNIT)).unwrap_or(u32::MAX)
}

fn places(bytes: u64) -> Arc<Semaphore> {
    Arc::new(Semaphore::new(units(bytes) as usize))
}

/// What all clients share.
#[derive(Debug)]
pub(super) struct Shares {
    input: Arc<Semaphore>,
    output: Arc<Semaphore>,
    next_number: AtomicU64,
    connected: AtomicU64,
    /// Requests that were refused for what they would take.
    refused: AtomicU64,
}

impl Default for Shares {
    fn default() -> Self {
        Self {
            input: places(INPUT),
            output: places(OUTPUT),
            next_number: AtomicU64::new(1),
            connected: AtomicU64::new(0),
            refused: AtomicU64::new(0),
        }
    }
}

impl Shares {
    /// Connections now.
    pub(super) fn connections(&self) -> u64 {
        self.connected.load(Relaxed)
    }

    /// Requests that were refused for what they would take.
    pub(super) fn refused(&self) -> u64 {
        self.refused.load(Relaxed)
    }
}

/// Bytes that are held until the last clone is gone.
#[derive(Clone, Debug)]
pub(super) struct Held {
    permits: Vec<Arc<[OwnedSemaphorePermit; 2]>>,
}

impl Held {
    /// These and others together.
    pub(super) fn and(mut self, others: Self) -> Self {
        self.permits.extend(others.permits);
        self
    }
}

/// What a message takes: itself, and its copy in the connection.
fn output_of(message_bytes: u64) -> u64 {
    message_bytes.saturating_mul(2).min(OUTPUT_OF_ONE)
}

#[derive(Debug)]
struct Calls {
    /// Calls that are not finished.
    open: usize,
    /// How many there were.
    count: u64,
    /// When something came last.
    last_read: Instant,
    /// Answers of which a part was taken and the next not asked for, since when.
    handed_out: HashMap<u64, Instant>,
    next_answer: u64,
}

#[derive(Debug)]
struct Client {
    number: u64,
    from: From,
    /// The digest of its certificate, once that is verified.
    certificate: OnceLock<Digest>,
    since: Instant,
    renders: Arc<Semaphore>,
    quick: Semaphore,
    slow: Semaphore,
    input: Arc<Semaphore>,
    output: Arc<Semaphore>,
    calls: Mutex<Calls>,
    /// Its poses that have no line in the log yet.
    moves: Mutex<Option<Moves>>,
    shares: Arc<Shares>,
}

/// Where a client is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum From {
    /// At an address.
    Network(String),
    /// On this machine: the file permissions of the socket have let it through. The number of its user.
    LocalSocket(u32),
}

impl Drop for Client {
    fn drop(&mut self) {
        let count = self.calls.get_mut().unwrap_or_else(PoisonError::into_inner).count;
        if count > 0 {
            let seconds = self.since.elapsed().as_secs_f64();
            let rest = self.moves.get_mut().unwrap_or_else(PoisonError::into_inner).take().and_then(Moves::rest);
            let moves = rest.map_or_else(String::new, |moves| format!("; {}", moves.in_words()));
            tracing::info!(client = self.name(), "gone: {count} calls in {seconds:.1} s{moves}");
        }
        self.shares.connected.fetch_sub(1, Relaxed);
    }
}

impl Client {
    fn name(&self) -> String {
        match &self.from {
            From::Network(address) => format!("{} ({address})", self.number),
            From::LocalSocket(user) => format!("{} (user {user})", self.number),
        }
    }
}

/// A connection: every request carries it.
#[derive(Clone, Debug)]
pub(super) struct ClientInfo(Arc<Client>);

impl ClientInfo {
    /// A new one.
    pub(super) fn new(shares: &Arc<Shares>, from: From) -> Self {
        let now = Instant::now();
        shares.connected.fetch_add(1, Relaxed);
        let calls = Calls { open: 0, count: 0, last_read: now, handed_out: HashMap::new(), next_answer: 0 };
        Self(Arc::new(Client {
            number: shares.next_number.fetch_add(1, Relaxed),
            from,
            certificate: OnceLock::new(),
            since: now,
            renders: Arc::new(Semaphore::new(RENDERS)),
            quick: Semaphore::new(ENCODINGS),
            slow: Semaphore::new(SLOW_ENCODINGS),
            input: places(INPUT_OF_ONE),
            output: places(OUTPUT_OF_ONE),
            calls: Mutex::new(calls),
            moves: Mutex::default(),
            shares: Arc::clone(shares),
        }))
    }

    /// Who has sent a request.
    ///
    /// # Errors
    ///
    /// It did not come through a connection of the daemon.
    pub(super) fn of<T>(request: &tonic::Request<T>) -> Result<Self, Status> {
        let of_connection = request.extensions().get::<Self>().cloned();
        of_connection.ok_or_else(|| Status::internal("the request has no connection"))
    }

    /// For the log.
    pub(super) fn name(&self) -> String {
        self.0.name()
    }

    /// Whether it came through a socket of this machine, whose file permissions say who may.
    pub(super) fn is_local_socket(&self) -> bool {
        matches!(self.0.from, From::LocalSocket(_))
    }

    /// The digest of its certificate, which was verified; `None`: it has none.
    pub(super) fn certificate(&self) -> Option<Digest> {
        self.0.certificate.get().copied()
    }

    /// Keeps the digest of a certificate that was verified.
    pub(super) fn certify(&self, certificate: Digest) {
        // There is one handshake, and so one certificate.
        let _ = self.0.certificate.set(certificate);
    }

    fn calls(&self) -> MutexGuard<'_, Calls> {
        // Nothing can panic while the lock is held, so a poisoned state is whole.
        self.0.calls.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place of one of its calls of RenderFrame.
    pub(super) fn render(&self) -> Result<OwnedSemaphorePermit, Status> {
        Arc::clone(&self.0.renders).try_acquire_owned().map_err(|_| {
            self.refuse(format!(
                "this client has {RENDERS} calls of RenderFrame already, the most there may be: wait for one"
            ))
        })
    }

    /// Its places among those who encode.
    pub(super) fn encoding(&self, is_slow: bool) -> &Semaphore {
        if is_slow { &self.0.slow } else { &self.0.quick }
    }

    /// Room for bytes of requests.
    pub(super) fn hold_input(&self, bytes: u64) -> Result<Held, Status> {
        self.hold(bytes, &self.0.input, &self.0.shares.input).ok_or_else(|| {
            self.refuse(format!(
                "requests that are not complete may have {} MiB of one client, and {} MiB in all",
                INPUT_OF_ONE >> 20,
                INPUT >> 20
            ))
        })
    }

    /// Room for frames that are on their way: the message, and its copy in the connection.
    pub(super) fn hold_output(&self, message_bytes: u64) -> Result<Held, Status> {
        self.hold_more_output(0, message_bytes)
    }

    /// The room that frames take beyond that of smaller ones, which is held already.
    pub(super) fn hold_more_output(&self, held_message_bytes: u64, message_bytes: u64) -> Result<Held, Status> {
        let [held, bytes] = [held_message_bytes, message_bytes].map(output_of);
        // Both rounded, so that together they are what the larger one takes.
        let more = UNIT * u64::from(units(bytes).saturating_sub(units(held)));
        self.hold(more, &self.0.output, &self.0.shares.output).ok_or_else(|| {
            self.refuse(format!(
                "frames on their way may have {} MiB of one client, and {} MiB in all; this one takes {} MiB: end a stream, or ask for smaller \
                 images",
                OUTPUT_OF_ONE >> 20,
                OUTPUT >> 20,
                bytes >> 20
            ))
        })
    }

    fn hold(&self, bytes: u64, own: &Arc<Semaphore>, all: &Arc<Semaphore>) -> Option<Held> {
        let take = |of: &Arc<Semaphore>| Arc::clone(of).try_acquire_many_owned(units(bytes)).ok();
        Some(Held { permits: vec![Arc::new([take(own)?, take(all)?])] })
    }

    /// A request that would take more than it may.
    fn refuse(&self, problem: String) -> Status {
        self.0.shares.refused.fetch_add(1, Relaxed);
        tracing::debug!(client = self.name(), "refused: {problem}");
        refusals::exhausted("client", problem)
    }

    /// Notes a pose that brought the camera to a revision; the line that the log gets, if one is due.
    pub(super) fn note_move(&self, to: u64, now: Instant) -> Option<Moves> {
        Moves::note(&mut self.0.moves.lock().unwrap_or_else(PoisonError::into_inner), to, now)
    }

    /// Something came.
    pub(super) fn note_read(&self) {
        self.calls().last_read = Instant::now();
    }

    /// A call begins.
    pub(super) fn open_call(&self) -> OpenCall {
        let mut calls = self.calls();
        calls.open += 1;
        calls.count += 1;
        calls.next_answer += 1;
        OpenCall { client: self.clone(), number: calls.next_answer }
    }

    /// Why the connection is to be ended, if it is.
    pub(super) fn overdue(&self, now: Instant) -> Option<String> {
        let calls = self.calls();
        let longer = |since: &Instant, most: Duration| now.saturating_duration_since(*since) > most;
        if calls.count == 0 && longer(&self.0.since, FIRST_CALL) {
            return Some(format!("no call within {} s", FIRST_CALL.as_secs()));
        }
        if calls.handed_out.values().any(|since| longer(since, STALLED)) {
            return Some(format!("an answer was not read for {} s", STALLED.as_secs()));
        }
        let is_idle = calls.open == 0 && longer(&calls.last_read, IDLE);
        is_idle.then(|| format!("nothing came for {} s", IDLE.as_secs()))
    }
}

/// A call that is not finished.
#[derive(Debug)]
pub(super) struct OpenCall {
    client: ClientInfo,
    number: u64,
}

impl OpenCall {
    /// The connection asks for the next part of the answer, and has got one (`true`) or waits for it.
    pub(super) fn note(&self, got_part: bool) {
        let mut calls = self.client.calls();
        if got_part {
            calls.handed_out.insert(self.number, Instant::now());
        } else {
            calls.handed_out.remove(&self.number);
        }
    }
}

impl Drop for OpenCall {
    fn drop(&mut self) {
        let mut calls = self.client.calls();
        calls.handed_out.remove(&self.number);
        calls.open -= 1;
        // What follows the last call is idle time.
        calls.last_read = Instant::now();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    fn client(shares: &Arc<Shares>) -> ClientInfo {
        ClientInfo::new(shares, From::Network("test".to_owned()))
    }

    #[test]
    fn bytes_are_bounded_for_one_and_for_all_and_come_back() {
        let shares = Arc::default();
        let first = client(&shares);
        let half = first.hold_input(INPUT_OF_ONE / 2).unwrap();
        let _rest = first.hold_input(INPUT_OF_ONE / 2).unwrap();
        assert_eq!(first.hold_input(1).unwrap_err().code(), tonic::Code::ResourceExhausted);
        drop(half);
        drop(first.hold_input(INPUT_OF_ONE / 2).unwrap());
        let others: Vec<ClientInfo> = (0..4).map(|_| client(&shares)).collect();
        let held: Vec<Held> = others.iter().filter_map(|other| other.hold_input(INPUT_OF_ONE).ok()).collect();
        assert_eq!(held.len() as u64, INPUT / INPUT_OF_ONE - 1, "the rest is held by the first");
        // One frame goes through, however large it is.
        let frame = first.hold_output(u64::MAX / 4).unwrap();
        assert!(first.hold_output(UNIT).is_err());
        drop(frame);
        first.hold_output(UNIT).unwrap();
    }

    #[test]
    fn frames_that_have_become_larger_take_what_they_would_have_taken_at_once() {
        let shares = Arc::default();
        let client = client(&shares);
        let free = || client.0.output.available_permits();
        let all = free();
        for (before, after) in [(1, UNIT), (700, 700), (5 * UNIT + 1, 9 * UNIT + 3), (999, OUTPUT), (9 * UNIT, 3)] {
            let at_once = client.hold_output(after.max(before)).unwrap();
            let taken = free();
            drop(at_once);
            let both = client.hold_output(before).unwrap().and(client.hold_more_output(before, after).unwrap());
            assert_eq!(free(), taken, "{before} to {after}");
            drop(both);
            assert_eq!(free(), all);
        }
        let _other = client.hold_output(OUTPUT_OF_ONE / 4).unwrap();
        let small = client.hold_output(UNIT).unwrap();
        assert_eq!(client.hold_more_output(UNIT, OUTPUT_OF_ONE).unwrap_err().code(), tonic::Code::ResourceExhausted);
        drop(small);
    }

    #[test]
    fn a_connection_is_ended_that_says_nothing_reads_nothing_or_rests_too_long() {
        let shares = Arc::default();
        let new = client(&shares);
        let begun = new.0.since;
        assert_eq!(new.overdue(begun + FIRST_CALL), None);
        assert!(new.overdue(begun + FIRST_CALL + UNIT_OF_TIME).unwrap().contains("no call within 10 s"));

        let reader = client(&shares);
        let call = reader.open_call();
        let late = Instant::now() + STALLED + UNIT_OF_TIME;
        call.note(true);
        assert!(reader.overdue(late).unwrap().contains("not read for 60 s"));
        call.note(false);
        assert_eq!(reader.overdue(late + IDLE), None, "it waits for the daemon");
        drop(call);
        assert_eq!(reader.overdue(Instant::now() + IDLE - UNIT_OF_TIME), None);
        assert!(reader.overdue(Instant::now() + IDLE + UNIT_OF_TIME).unwrap().contains("nothing came for 120 s"));
        reader.note_read();
    }

    const UNIT_OF_TIME: Duration = Duration::from_secs(1);
}
