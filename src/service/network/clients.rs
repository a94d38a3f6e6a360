//! Connected clients, and the limits of each client's share of common resources: places for waiting calls, places among the encoders, and bytes in
//! memory.

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
    http_handler::is_monitoring,
    log_summary::{Kind, LogSummary},
};
use crate::service::wire::refusals;

/// Maximum number of concurrent RenderFrame calls of one client.
const RENDERS: usize = 4;
/// Minimum share of one client in the daemon's streams of frames, and in those of scene, camera and statistics. If a quarter of the streams of frames
/// is more, that quarter is the share.
const LEAST_STREAMS: usize = 16;
/// Maximum number of concurrent Identify calls of one client.
const SEARCHES: usize = 2;
/// Maximum number of concurrent changes of one client, including those that wait for other changes.
const CHANGES: usize = 16;
/// Maximum number of frames of one client that are being encoded, or wait for an encoder of their kind.
const ENCODINGS: usize = 2;
/// The same limit for slow encodings.
const SLOW_ENCODINGS: usize = 1;
/// Unit in which bytes are counted.
const UNIT: u64 = 1024;
/// Maximum size of incomplete requests, bytes: for one client, and for all.
const INPUT_OF_ONE: u64 = 16 << 20;
const INPUT: u64 = 64 << 20;
/// Maximum size of frames in transit, bytes: for one client, and for all. A frame above the limit of one client is accepted if that client has no
/// other frame in transit.
const OUTPUT_OF_ONE: u64 = 512 << 20;
const OUTPUT: u64 = 1 << 30;

/// A connection without any call is closed after this time.
const FIRST_CALL: Duration = Duration::from_secs(10);
/// The same while more than [`MOST_SILENT`] connections have made no call, so that they do not keep others out.
const FIRST_CALL_OF_MANY: Duration = Duration::from_secs(1);
/// Number of silent connections above which the shorter time applies: half of the places for connections.
const MOST_SILENT: u64 = 256;
/// A connection whose client does not read its answers is closed after this time.
const STALLED: Duration = Duration::from_secs(60);
/// A connection without calls and without received data is closed after this time. HTTP/2 clients answer pings in the
/// meantime.
const IDLE: Duration = Duration::from_secs(120);

fn units(bytes: u64) -> u32 {
    u32::try_from(bytes.div_ceil(UNIT)).unwrap_or(u32::MAX)
}

fn places(bytes: u64) -> Arc<Semaphore> {
    Arc::new(Semaphore::new(units(bytes) as usize))
}

/// Resources that all clients share.
#[derive(Debug)]
pub(crate) struct Shares {
    input: Arc<Semaphore>,
    output: Arc<Semaphore>,
    /// Streams of one client, of each kind.
    streams_of_one: usize,
    next_number: AtomicU64,
    connected: AtomicU64,
    /// Connections that have made no call.
    silent: AtomicU64,
    /// Number of requests that were refused because of a limit.
    refused: AtomicU64,
    log: Arc<LogSummary>,
}

impl Shares {
    /// Creates the shares of a daemon with this maximum number of streams of frames.
    pub(crate) fn new(streams: usize) -> Self {
        Self {
            input: places(INPUT),
            output: places(OUTPUT),
            streams_of_one: (streams / 4).max(LEAST_STREAMS),
            next_number: AtomicU64::new(1),
            connected: AtomicU64::new(0),
            silent: AtomicU64::new(0),
            refused: AtomicU64::new(0),
            log: Arc::default(),
        }
    }

    /// Returns the number of open connections.
    pub(crate) fn connections(&self) -> u64 {
        self.connected.load(Relaxed)
    }

    /// Returns the number of requests that were refused because of a limit.
    pub(crate) fn refused(&self) -> u64 {
        self.refused.load(Relaxed)
    }
}

/// Reserved bytes, which are released with the last clone.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    permits: Vec<Arc<[OwnedSemaphorePermit; 2]>>,
}

impl Held {
    /// Combines two reservations.
    pub(crate) fn and(mut self, others: Self) -> Self {
        self.permits.extend(others.permits);
        self
    }
}

/// Returns the bytes of a message in transit, which include its copy in the connection.
fn output_of(message_bytes: u64) -> u64 {
    message_bytes.saturating_mul(2).min(OUTPUT_OF_ONE)
}

#[derive(Debug)]
struct Calls {
    /// Number of unfinished calls.
    open: usize,
    /// Number of all calls.
    count: u64,
    /// Number of calls from monitoring.
    monitoring: u64,
    /// Time of the last received data.
    last_read: Instant,
    /// Answers that were read in part, and the time of the last read.
    handed_out: HashMap<u64, Instant>,
    next_answer: u64,
}

#[derive(Debug)]
struct Client {
    number: u64,
    from: From,
    /// Digest of the verified client certificate.
    certificate: OnceLock<Digest>,
    since: Instant,
    renders: Arc<Semaphore>,
    streams: Arc<Semaphore>,
    watches: Arc<Semaphore>,
    searches: Arc<Semaphore>,
    changes: Arc<Semaphore>,
    quick: Semaphore,
    slow: Semaphore,
    input: Arc<Semaphore>,
    output: Arc<Semaphore>,
    calls: Mutex<Calls>,
    /// Camera poses that are not logged yet.
    moves: Mutex<Option<Moves>>,
    shares: Arc<Shares>,
}

/// Origin of a connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum From {
    /// A network address.
    Network(String),
    /// A Unix socket, whose file permissions admit the client, with the user id.
    LocalSocket(u32),
}

impl Drop for Client {
    fn drop(&mut self) {
        let calls = self.calls.get_mut().unwrap_or_else(PoisonError::into_inner);
        let is_silent = calls.count == 0;
        // Monitoring makes a connection every few seconds.
        let count = calls.count - calls.monitoring;
        if count > 0 {
            let seconds = self.since.elapsed().as_secs_f64();
            let rest = self.moves.get_mut().unwrap_or_else(PoisonError::into_inner).take().and_then(Moves::rest);
            let line = format!("disconnected: {count} calls in {seconds:.1} s");
            match rest {
                // This line is part of the log of changes, which must be complete.
                Some(moves) => tracing::info!(client = self.name(), "{line}; {}", moves.in_words()),
                None => self.log(Kind::Disconnected, &line),
            }
        }
        self.shares.connected.fetch_sub(1, Relaxed);
        if is_silent {
            self.shares.silent.fetch_sub(1, Relaxed);
        }
    }
}

impl Client {
    fn name(&self) -> String {
        match &self.from {
            From::Network(address) => format!("{} ({address})", self.number),
            From::LocalSocket(user) => format!("{} (user {user})", self.number),
        }
    }

    /// Logs a line, or counts it with others of this kind and address.
    fn log(&self, kind: Kind, line: &str) {
        let address = match &self.from {
            From::Network(address) => address.rsplit_once(':').map_or(&**address, |(host, _)| host),
            From::LocalSocket(_) => "local socket",
        };
        self.shares.log.write(kind, address, &self.name(), line);
    }
}

/// Handle of a client's connection, which every request on it contains as an extension.
#[derive(Clone, Debug)]
pub(crate) struct ClientInfo(Arc<Client>);

impl ClientInfo {
    /// Creates the record of a new connection.
    pub(crate) fn new(shares: &Arc<Shares>, from: From) -> Self {
        let now = Instant::now();
        shares.connected.fetch_add(1, Relaxed);
        shares.silent.fetch_add(1, Relaxed);
        let calls =
            Calls { open: 0, count: 0, monitoring: 0, last_read: now, handed_out: HashMap::new(), next_answer: 0 };
        Self(Arc::new(Client {
            number: shares.next_number.fetch_add(1, Relaxed),
            from,
            certificate: OnceLock::new(),
            since: now,
            renders: Arc::new(Semaphore::new(RENDERS)),
            streams: Arc::new(Semaphore::new(shares.streams_of_one)),
            watches: Arc::new(Semaphore::new(shares.streams_of_one)),
            searches: Arc::new(Semaphore::new(SEARCHES)),
            changes: Arc::new(Semaphore::new(CHANGES)),
            quick: Semaphore::new(ENCODINGS),
            slow: Semaphore::new(SLOW_ENCODINGS),
            input: places(INPUT_OF_ONE),
            output: places(OUTPUT_OF_ONE),
            calls: Mutex::new(calls),
            moves: Mutex::default(),
            shares: Arc::clone(shares),
        }))
    }

    /// Returns the connection of a request.
    ///
    /// # Errors
    ///
    /// The request did not come through a connection of the daemon.
    pub(crate) fn from_request<T>(request: &tonic::Request<T>) -> Result<Self, Status> {
        let of_connection = request.extensions().get::<Self>().cloned();
        of_connection.ok_or_else(|| Status::internal("the request has no connection"))
    }

    /// Returns the name of the client for the log.
    pub(crate) fn name(&self) -> String {
        self.0.name()
    }

    /// Logs a line that the client causes, or counts it with others of this kind from its address.
    pub(crate) fn log(&self, kind: Kind, line: &str) {
        self.0.log(kind, line);
    }

    /// Whether the client uses a Unix socket, whose file permissions control access.
    pub(crate) fn is_local_socket(&self) -> bool {
        matches!(self.0.from, From::LocalSocket(_))
    }

    /// Returns the digest of the verified certificate; `None` if the client has none.
    pub(crate) fn certificate(&self) -> Option<Digest> {
        self.0.certificate.get().copied()
    }

    /// Stores the digest of a verified certificate.
    pub(crate) fn certify(&self, certificate: Digest) {
        // A connection has one handshake, and so one certificate.
        let _ = self.0.certificate.set(certificate);
    }

    fn calls(&self) -> MutexGuard<'_, Calls> {
        // Nothing can panic while the lock is held, so a poisoned state is consistent.
        self.0.calls.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reserves one of the client's places; `what` and `advice` complete the refusal.
    fn place(
        &self,
        of: &Arc<Semaphore>,
        most: usize,
        what: &str,
        advice: &str,
    ) -> Result<OwnedSemaphorePermit, Status> {
        let place = Arc::clone(of).try_acquire_owned();
        place.map_err(|_| self.refuse(format!("this client has {most} {what}, the maximum of one client: {advice}")))
    }

    /// Reserves one of the client's RenderFrame calls.
    pub(crate) fn render(&self) -> Result<OwnedSemaphorePermit, Status> {
        self.place(&self.0.renders, RENDERS, "calls of RenderFrame", "wait for one to finish")
    }

    /// Reserves one of the client's streams of frames and calls of NextFrame.
    pub(crate) fn stream(&self) -> Result<OwnedSemaphorePermit, Status> {
        let most = self.0.shares.streams_of_one;
        self.place(&self.0.streams, most, "streams of frames and calls of NextFrame", "end one first")
    }

    /// Reserves one of the client's streams of scene, camera and statistics.
    pub(crate) fn watch(&self) -> Result<OwnedSemaphorePermit, Status> {
        let most = self.0.shares.streams_of_one;
        self.place(&self.0.watches, most, "streams of scene, camera and statistics", "end one first")
    }

    /// Reserves one of the client's Identify calls.
    pub(crate) fn search(&self) -> Result<OwnedSemaphorePermit, Status> {
        self.place(&self.0.searches, SEARCHES, "calls of Identify", "wait for one to finish")
    }

    /// Reserves one of the client's changes of scene and views.
    pub(crate) fn change(&self) -> Result<OwnedSemaphorePermit, Status> {
        self.place(&self.0.changes, CHANGES, "changes that are being made", "wait for one to finish")
    }

    /// Returns the client's places among encoders.
    pub(crate) fn encoding(&self, is_slow: bool) -> &Semaphore {
        if is_slow { &self.0.slow } else { &self.0.quick }
    }

    /// Reserves bytes of requests.
    pub(crate) fn hold_input(&self, bytes: u64) -> Result<Held, Status> {
        self.hold(bytes, &self.0.input, &self.0.shares.input).ok_or_else(|| {
            self.refuse(format!(
                "incomplete requests may take at most {} MiB for one client, and {} MiB for all",
                INPUT_OF_ONE >> 20,
                INPUT >> 20
            ))
        })
    }

    /// Reserves bytes of frames in transit: the message, and its copy in the connection.
    pub(crate) fn hold_output(&self, message_bytes: u64) -> Result<Held, Status> {
        self.hold_more_output(0, message_bytes)
    }

    /// Reserves bytes for a larger frame in addition to those that are reserved for a smaller one.
    pub(crate) fn hold_more_output(&self, held_message_bytes: u64, message_bytes: u64) -> Result<Held, Status> {
        let [held, bytes] = [held_message_bytes, message_bytes].map(output_of);
        // Round both, so that the sum equals the reservation of the larger frame.
        let more = UNIT * u64::from(units(bytes).saturating_sub(units(held)));
        self.hold(more, &self.0.output, &self.0.shares.output).ok_or_else(|| {
            self.refuse(format!(
                "frames in transit may take {} MiB for one client, and {} MiB for all; this one takes {} MiB: end a stream, or request smaller \
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

    /// Counts a request that exceeds a limit.
    fn refuse(&self, problem: String) -> Status {
        self.0.shares.refused.fetch_add(1, Relaxed);
        tracing::debug!(client = self.name(), "refused: {problem}");
        refusals::exhausted("client", problem)
    }

    /// Records a pose with the revision of the camera, and logs a line if one is due.
    pub(crate) fn note_move(&self, to: u64, now: Instant) -> Option<Moves> {
        Moves::note(&mut self.0.moves.lock().unwrap_or_else(PoisonError::into_inner), to, now)
    }

    /// Records received data.
    pub(crate) fn note_read(&self) {
        self.calls().last_read = Instant::now();
    }

    /// Records the start of a call.
    pub(crate) fn open_call(&self, path: &str) -> OpenCall {
        let mut calls = self.calls();
        calls.open += 1;
        if calls.count == 0 {
            self.0.shares.silent.fetch_sub(1, Relaxed);
        }
        calls.count += 1;
        calls.monitoring += u64::from(is_monitoring(path));
        calls.next_answer += 1;
        OpenCall { client: self.clone(), number: calls.next_answer }
    }

    /// Returns the reason to close the connection, if there is one.
    pub(crate) fn overdue(&self, now: Instant) -> Option<String> {
        let calls = self.calls();
        let longer = |since: &Instant, most: Duration| now.saturating_duration_since(*since) > most;
        let are_many = self.0.shares.silent.load(Relaxed) > MOST_SILENT;
        let first_call = if are_many { FIRST_CALL_OF_MANY } else { FIRST_CALL };
        if calls.count == 0 && longer(&self.0.since, first_call) {
            return Some(format!("no call within {} s", first_call.as_secs()));
        }
        if calls.handed_out.values().any(|since| longer(since, STALLED)) {
            return Some(format!("an answer was not read for {} s", STALLED.as_secs()));
        }
        let is_idle = calls.open == 0 && longer(&calls.last_read, IDLE);
        is_idle.then(|| format!("nothing received for {} s", IDLE.as_secs()))
    }
}

/// An unfinished call.
#[derive(Debug)]
pub(crate) struct OpenCall {
    client: ClientInfo,
    number: u64,
}

impl OpenCall {
    /// Records that the connection has requested the next part of the answer, and has got it (`true`) or is waiting for it.
    pub(crate) fn note(&self, got_part: bool) {
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
        // The idle time starts at the end of the last call.
        calls.last_read = Instant::now();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    fn some_shares() -> Arc<Shares> {
        Arc::new(Shares::new(256))
    }

    fn client(shares: &Arc<Shares>) -> ClientInfo {
        ClientInfo::new(shares, From::Network("test".to_owned()))
    }

    #[test]
    fn bytes_are_limited_per_client_and_in_total_and_released() {
        let shares = some_shares();
        let first = client(&shares);
        let half = first.hold_input(INPUT_OF_ONE / 2).unwrap();
        let _rest = first.hold_input(INPUT_OF_ONE / 2).unwrap();
        assert_eq!(first.hold_input(1).unwrap_err().code(), tonic::Code::ResourceExhausted);
        drop(half);
        drop(first.hold_input(INPUT_OF_ONE / 2).unwrap());
        let others: Vec<ClientInfo> = (0..4).map(|_| client(&shares)).collect();
        let held: Vec<Held> = others.iter().filter_map(|other| other.hold_input(INPUT_OF_ONE).ok()).collect();
        assert_eq!(held.len() as u64, INPUT / INPUT_OF_ONE - 1, "the first client holds the rest");
        // A single frame is accepted whatever its size.
        let frame = first.hold_output(u64::MAX / 4).unwrap();
        assert!(first.hold_output(UNIT).is_err());
        drop(frame);
        first.hold_output(UNIT).unwrap();
    }

    /// A client that has taken its share must leave the rest to others.
    #[test]
    fn places_are_limited_per_client_and_released() {
        let shares = some_shares();
        let [first, second] = [client(&shares), client(&shares)];
        type Take = fn(&ClientInfo) -> Result<OwnedSemaphorePermit, Status>;
        let kinds: [(Take, usize, &str); 5] = [
            (ClientInfo::render, RENDERS, "calls of RenderFrame"),
            (ClientInfo::stream, 64, "streams of frames"),
            (ClientInfo::watch, 64, "streams of scene"),
            (ClientInfo::search, SEARCHES, "calls of Identify"),
            (ClientInfo::change, CHANGES, "changes"),
        ];
        for (take, most, what) in kinds {
            let mut taken: Vec<_> = (0..most).map(|_| take(&first).unwrap()).collect();
            let refusal = take(&first).unwrap_err();
            assert_eq!(refusal.code(), tonic::Code::ResourceExhausted);
            assert!(refusal.message().contains(&format!("this client has {most} {what}")), "{refusal}");
            drop(take(&second).unwrap());
            taken.pop();
            drop(take(&first).unwrap());
        }
        assert_eq!(shares.refused(), kinds.len() as u64);
        assert_eq!(Shares::new(20).streams_of_one, LEAST_STREAMS);
    }

    #[test]
    fn a_grown_frame_reserves_as_much_as_one_large_reservation() {
        let shares = some_shares();
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
    fn silent_stalled_and_idle_connections_are_closed() {
        let shares = some_shares();
        let new = client(&shares);
        let begun = new.0.since;
        assert_eq!(new.overdue(begun + FIRST_CALL), None);
        assert!(new.overdue(begun + FIRST_CALL + UNIT_OF_TIME).unwrap().contains("no call within 10 s"));

        // If many connections are silent, they have less time. A connection with a call is not silent.
        let calling: Vec<_> = (0..MOST_SILENT).map(|_| client(&shares)).collect();
        let calls: Vec<_> = calling.iter().map(|client| client.open_call("")).collect();
        assert_eq!(new.overdue(begun + FIRST_CALL), None);
        let others: Vec<_> = (0..MOST_SILENT).map(|_| client(&shares)).collect();
        assert_eq!(new.overdue(begun + FIRST_CALL_OF_MANY), None);
        assert!(new.overdue(begun + 2 * FIRST_CALL_OF_MANY).unwrap().contains("no call within 1 s"));
        assert_eq!(calling[0].overdue(begun + FIRST_CALL), None);
        drop((calls, calling, others));
        assert_eq!(new.overdue(begun + FIRST_CALL), None);

        let reader = client(&shares);
        let call = reader.open_call("");
        let late = Instant::now() + STALLED + UNIT_OF_TIME;
        call.note(true);
        assert!(reader.overdue(late).unwrap().contains("not read for 60 s"));
        call.note(false);
        assert_eq!(reader.overdue(late + IDLE), None, "the client waits for the daemon");
        drop(call);
        assert_eq!(reader.overdue(Instant::now() + IDLE - UNIT_OF_TIME), None);
        assert!(reader.overdue(Instant::now() + IDLE + UNIT_OF_TIME).unwrap().contains("nothing received for 120 s"));
        reader.note_read();
    }

    const UNIT_OF_TIME: Duration = Duration::from_secs(1);
}
