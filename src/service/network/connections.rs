//! Connections: their number, the reasons to close one, and the limits of incomplete requests.

use std::{
    io,
    net::IpAddr,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
    time::{Duration, Instant},
};

use bytes::Buf;
use http::{HeaderValue, Request, Response, StatusCode, header};
use http_body::{Body as HttpBody, Frame, SizeHint};
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::{TcpListener, TcpStream},
    runtime::Handle,
    sync::{OwnedSemaphorePermit, Semaphore, watch},
    time::{Interval, MissedTickBehavior, Sleep, interval, sleep},
};
use tokio_rustls::{Accept, TlsAcceptor, server::TlsStream};
use tonic::{Status, body::Body, codegen::BoxFuture, transport::server::Connected};
use tower_layer::Layer;
use tower_service::Service;

use super::{
    access::{Access, digest_of},
    clients::{ClientInfo, From, Held, OpenCall, Shares},
    http_handler::{PLAIN, refused_call, text},
    log_summary::Kind,
};
use crate::{
    platform::{
        process,
        sockets::{LocalListener, LocalStream},
    },
    service::scene::excerpts::excerpt,
};

/// Maximum number of connections; further ones are closed at once.
const CONNECTIONS: usize = 512;
/// The number of connections is at most the number of the process's file descriptors divided by this.
const SHARE_OF_DESCRIPTORS: u64 = 2;
/// A request must be complete after this time; a stream of poses is exempt while its call lasts.
const REQUEST: Duration = Duration::from_secs(30);
/// Calls whose requests are streams of small messages without an end.
const STREAMED_REQUESTS: [&str; 1] = ["/steradian.v1.CameraService/StreamCamera"];
/// Interval between checks of a connection.
const LOOK: Duration = Duration::from_secs(1);
/// Maximum length of a foreign host or page in messages, bytes.
const MOST_FOREIGN: usize = 96;
/// Pause after an accept that failed for a temporary reason, such as a lack of descriptors.
const BACK_OFF: Duration = Duration::from_millis(200);

/// Listening socket.
pub(crate) enum Listener {
    /// A TCP port.
    Tcp(TcpListener),
    /// A Unix socket.
    Local(LocalListener),
}

impl Listener {
    /// Returns two listeners for the same socket: one in this runtime, and one in the runtime `other`.
    pub(crate) fn twice(self, other: &Handle) -> io::Result<(Self, Self)> {
        Ok(match self {
            Self::Tcp(listener) => {
                let listener = listener.into_std()?;
                let copy = listener.try_clone()?;
                let listener = TcpListener::from_std(listener)?;
                let _inside = other.enter();
                (Self::Tcp(listener), Self::Tcp(TcpListener::from_std(copy)?))
            }
            Self::Local(listener) => {
                let (listener, other) = listener.twice(other)?;
                (Self::Local(listener), Self::Local(other))
            }
        })
    }

    fn poll_accept(&self, context: &mut Context<'_>) -> Poll<io::Result<(Stream, From)>> {
        match self {
            Self::Tcp(listener) => {
                let (stream, address) = ready!(listener.poll_accept(context))?;
                stream.set_nodelay(true)?;
                Poll::Ready(Ok((Stream::Tcp(stream), From::Network(address.to_string()))))
            }
            Self::Local(listener) => {
                let (stream, user) = ready!(listener.poll_accept(context))?;
                Poll::Ready(Ok((Stream::Local(stream), From::LocalSocket(user))))
            }
        }
    }
}

/// Stream of accepted connections.
pub(crate) struct Incoming {
    listener: Listener,
    access: watch::Receiver<Arc<Access>>,
    places: Arc<Semaphore>,
    shares: Arc<Shares>,
    /// End of the pause after an error.
    pause: Option<Pin<Box<Sleep>>>,
    /// Whether a problem has been logged already.
    in_trouble: bool,
}

impl Incoming {
    pub(crate) fn new(listener: Listener, access: watch::Receiver<Arc<Access>>, shares: Arc<Shares>) -> Self {
        let places = Arc::new(Semaphore::new(most_connections()));
        Self { listener, access, places, shares, pause: None, in_trouble: false }
    }

    fn trouble(&mut self, problem: &str) {
        if !std::mem::replace(&mut self.in_trouble, true) {
            tracing::warn!("{problem}");
        }
    }
}

/// Returns the maximum number of connections that the process's file descriptors allow.
fn most_connections() -> usize {
    let share =
        process::open_files_limit().map_or(CONNECTIONS as u64, |descriptors| descriptors / SHARE_OF_DESCRIPTORS);
    CONNECTIONS.min(usize::try_from(share).unwrap_or(CONNECTIONS)).max(1)
}

impl tokio_stream::Stream for Incoming {
    type Item = io::Result<Connection>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        loop {
            if let Some(pause) = &mut self.pause {
                ready!(pause.as_mut().poll(context));
                self.pause = None;
            }
            match ready!(self.listener.poll_accept(context)) {
                Ok((stream, from)) => {
                    let Ok(place) = Arc::clone(&self.places).try_acquire_owned() else {
                        // Close at once, so that the client gets an error and does not wait.
                        let most = most_connections();
                        self.trouble(&format!("there are {most} connections, the maximum: further ones are closed"));
                        continue;
                    };
                    self.in_trouble = false;
                    let client = ClientInfo::new(&self.shares, from);
                    // A Unix socket needs no encryption.
                    let stream = match (stream, &self.access.borrow().tls) {
                        (Stream::Tcp(stream), Some(tls)) => {
                            Stream::Handshake(Box::new(TlsAcceptor::from(Arc::clone(tls)).accept(stream)))
                        }
                        (stream, _) => stream,
                    };
                    return Poll::Ready(Some(Ok(Connection::new(stream, client, place))));
                }
                // The peer disconnected before it was accepted.
                Err(error) if is_of_one_connection(&error) => {}
                Err(error) => {
                    self.trouble(&format!("cannot accept connections at present: {error}"));
                    self.pause = Some(Box::pin(sleep(BACK_OFF)));
                }
            }
        }
    }
}

fn is_of_one_connection(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset, Interrupted};
    use io::ErrorKind::{InvalidInput, NotConnected};
    matches!(
        error.kind(),
        ConnectionAborted | ConnectionRefused | ConnectionReset | Interrupted | InvalidInput | NotConnected
    )
}

/// The byte stream of a connection.
enum Stream {
    Tcp(TcpStream),
    Local(LocalStream),
    /// TLS, during the handshake.
    Handshake(Box<Accept<TcpStream>>),
    Tls(Box<TlsStream<TcpStream>>),
    /// The handshake failed.
    Closed,
}

impl Stream {
    /// Completes a handshake.
    fn poll_open(&mut self, client: &ClientInfo, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let Self::Handshake(accept) = self else { return Poll::Ready(Ok(())) };
        match ready!(Pin::new(accept).poll(context)) {
            Ok(stream) => {
                let certificates = stream.get_ref().1.peer_certificates();
                if let Some(certificate) = certificates.and_then(<[_]>::first) {
                    client.certify(digest_of(certificate));
                }
                *self = Self::Tls(Box::new(stream));
                Poll::Ready(Ok(()))
            }
            Err(error) => {
                client.log(Kind::Handshake, &format!("TLS handshake failed: {error}"));
                *self = Self::Closed;
                Poll::Ready(Err(error))
            }
        }
    }

    fn poll_with<T>(
        &mut self,
        client: &ClientInfo,
        context: &mut Context<'_>,
        work: impl FnOnce(Pin<&mut dyn Bytes>, &mut Context<'_>) -> Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        ready!(self.poll_open(client, context))?;
        let stream: Pin<&mut dyn Bytes> = match self {
            Self::Tcp(stream) => Pin::new(stream),
            Self::Local(stream) => Pin::new(stream),
            Self::Tls(stream) => Pin::new(stream.as_mut()),
            Self::Handshake(_) | Self::Closed => return Poll::Ready(Err(io::ErrorKind::NotConnected.into())),
        };
        work(stream, context)
    }
}

/// A byte stream that can be read from and written to.
trait Bytes: AsyncRead + AsyncWrite + Unpin + Send {}

impl<T: AsyncRead + AsyncWrite + Unpin + Send> Bytes for T {}

/// A connection that closes itself if its client is silent or does not read its answers.
pub(crate) struct Connection {
    stream: Stream,
    client: ClientInfo,
    look: Interval,
    _place: OwnedSemaphorePermit,
}

impl Connection {
    fn new(stream: Stream, client: ClientInfo, place: OwnedSemaphorePermit) -> Self {
        let mut look = interval(LOOK);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        tracing::debug!(client = client.name(), "connected");
        Self { stream, client, look, _place: place }
    }
}

impl Connection {
    fn poll_with<T>(
        &mut self,
        context: &mut Context<'_>,
        work: impl FnOnce(Pin<&mut dyn Bytes>, &mut Context<'_>) -> Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        self.stream.poll_with(&self.client, context, work)
    }
}

impl Connected for Connection {
    type ConnectInfo = ClientInfo;

    fn connect_info(&self) -> ClientInfo {
        self.client.clone()
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        while self.look.poll_tick(context).is_ready() {
            if let Some(why) = self.client.overdue(Instant::now()) {
                self.client.log(Kind::Closed, &format!("connection closed: {why}"));
                return Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, why)));
            }
        }
        let before = buffer.filled().len();
        let read = ready!(self.poll_with(context, |stream, context| stream.poll_read(context, buffer)));
        if buffer.filled().len() > before {
            self.client.note_read();
        }
        Poll::Ready(read)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        self.poll_with(context, |stream, context| stream.poll_write(context, bytes))
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.poll_with(context, |stream, context| stream.poll_flush(context))
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.poll_with(context, |stream, context| stream.poll_shutdown(context))
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        self.poll_with(context, |stream, context| stream.poll_write_vectored(context, slices))
    }

    fn is_write_vectored(&self) -> bool {
        match &self.stream {
            Stream::Tcp(stream) => stream.is_write_vectored(),
            Stream::Local(stream) => stream.is_write_vectored(),
            Stream::Tls(stream) => stream.is_write_vectored(),
            Stream::Handshake(_) | Stream::Closed => false,
        }
    }
}

/// Checks that a call names this daemon: by an address, as `localhost`, or by one of the configured names. This refuses
/// pages of another site whose name resolves to this machine, and calls from pages that the daemon did not serve.
fn check_names(hosts: &[String], host: Option<&str>, origin: Option<&HeaderValue>) -> Result<(), String> {
    // The host without the port; an IPv6 address is in brackets.
    let name_of = |authority: &str| match authority.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
        Some((address, _)) => address.to_owned(),
        None => authority.split(':').next().unwrap_or_default().to_ascii_lowercase(),
    };
    let host = host.unwrap_or_default();
    let name = name_of(host);
    let is_known = name == "localhost"
        || name.parse::<IpAddr>().is_ok()
        || hosts.iter().any(|known| known.eq_ignore_ascii_case(&name));
    if !is_known {
        let host = excerpt(host, MOST_FOREIGN);
        return Err(format!("the host `{host}` must be one of server.hosts, an address or localhost"));
    }
    let Some(origin) = origin else { return Ok(()) };
    let origin = origin.to_str().unwrap_or("?");
    match origin.split_once("://") {
        Some((_, authority)) if authority.eq_ignore_ascii_case(host) => Ok(()),
        _ => Err(format!(
            "pages of `{}` may not call: only pages that the daemon serves itself, at {host}",
            excerpt(origin, MOST_FOREIGN)
        )),
    }
}

/// Layer that enforces the limits of every call.
#[derive(Clone)]
pub(crate) struct Bounds {
    hosts: Arc<[String]>,
}

impl Bounds {
    pub(crate) fn new(hosts: Vec<String>) -> Self {
        Self { hosts: hosts.into() }
    }
}

impl<S> Layer<S> for Bounds {
    type Service = Bounded<S>;

    fn layer(&self, inner: S) -> Bounded<S> {
        Bounded { inner, hosts: Arc::clone(&self.hosts) }
    }
}

/// Service with limits.
#[derive(Clone)]
pub(crate) struct Bounded<S> {
    inner: S,
    hosts: Arc<[String]>,
}

impl<S> Service<Request<Body>> for Bounded<S>
where
    S: Service<Request<Body>, Response = Response<Body>>,
    S::Future: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = BoxFuture<Self::Response, Self::Error>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        let Some(client) = request.extensions().get::<ClientInfo>().cloned() else {
            return Box::pin(async { Ok(Status::internal("the request has no connection").into_http()) });
        };
        let call = client.open_call(request.uri().path());
        // If there are several such headers, a proxy in front of the daemon may use another one than the daemon (RFC 9112, section 3.2).
        if request.headers().get_all(header::HOST).iter().nth(1).is_some() {
            let problem = "a request must have one header `host`, not several";
            client.log(Kind::Misnamed, &format!("refused: {problem}"));
            return Box::pin(async move { Ok(text(StatusCode::BAD_REQUEST, PLAIN, format!("{problem}\n"))) });
        }
        let of_header = request.headers().get(header::HOST).and_then(|host| host.to_str().ok());
        let host = request.uri().authority().map(http::uri::Authority::as_str).or(of_header);
        // Browsers cannot reach a Unix socket.
        let names = match client.is_local_socket() {
            true => Ok(()),
            false => check_names(&self.hosts, host, request.headers().get(header::ORIGIN)),
        };
        if let Err(problem) = names {
            client.log(Kind::Misnamed, &format!("refused: {problem}"));
            let status = Status::permission_denied(problem);
            let refusal = refused_call(&request, &status)
                .unwrap_or_else(|| text(StatusCode::FORBIDDEN, PLAIN, format!("{}\n", status.message())));
            return Box::pin(async { Ok(refusal) });
        }
        let is_streamed = STREAMED_REQUESTS.contains(&request.uri().path());
        let request = request.map(|body| match is_streamed {
            true => body,
            false => {
                let deadline = Box::pin(sleep(REQUEST));
                Body::new(BoundedRequest { body, client: client.clone(), held: Vec::new(), deadline })
            }
        });
        let answer = self.inner.call(request);
        Box::pin(async move {
            let mut response = answer.await?;
            let held = response.extensions_mut().remove::<Held>();
            Ok(response.map(|body| Body::new(CountedAnswer { body, call, _held: held })))
        })
    }
}

/// A request whose bytes are reserved until it is read, and that must be complete in time.
struct BoundedRequest {
    body: Body,
    client: ClientInfo,
    held: Vec<Held>,
    deadline: Pin<Box<Sleep>>,
}

impl HttpBody for BoundedRequest {
    type Data = bytes::Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<bytes::Bytes>, Status>>> {
        let Poll::Ready(frame) = Pin::new(&mut self.body).poll_frame(context) else {
            ready!(self.deadline.as_mut().poll(context));
            let problem = format!("the request was not complete after {} s", REQUEST.as_secs());
            return Poll::Ready(Some(Err(Status::deadline_exceeded(problem))));
        };
        let bytes = frame.as_ref().and_then(|frame| frame.as_ref().ok()?.data_ref().map(Buf::remaining));
        if let Some(bytes) = bytes.filter(|bytes| *bytes > 0) {
            match self.client.hold_input(bytes as u64) {
                Ok(held) => self.held.push(held),
                Err(status) => return Poll::Ready(Some(Err(status))),
            }
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// An answer that counts as an open one of its connection until it is sent.
struct CountedAnswer {
    body: Body,
    call: OpenCall,
    _held: Option<Held>,
}

impl HttpBody for CountedAnswer {
    type Data = bytes::Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<bytes::Bytes>, Status>>> {
        let frame = Pin::new(&mut self.body).poll_frame(context);
        self.call.note(matches!(&frame, Poll::Ready(Some(Ok(_)))));
        frame
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hosts_must_be_listed_and_pages_must_be_the_daemons() {
        let hosts = ["Control.example.org".to_owned()];
        let check = |host: &str, origin: Option<&'static str>| {
            check_names(&hosts, Some(host), origin.map(HeaderValue::from_static).as_ref())
        };
        for (host, origin) in [
            ("127.0.0.1:7143", None),
            ("[::1]:7143", None),
            ("localhost", None),
            ("control.example.org:80", None),
            ("127.0.0.1:7143", Some("http://127.0.0.1:7143")),
            ("control.example.org", Some("https://control.example.org")),
        ] {
            assert_eq!(check(host, origin), Ok(()), "{host} {origin:?}");
        }
        for (host, origin, part) in [
            ("evil.example.org:7143", None, "evil.example.org"),
            ("127.0.0.1.evil.example.org", None, "server.hosts"),
            ("", None, "server.hosts"),
            ("127.0.0.1:7143", Some("http://evil.example.org"), "evil.example.org"),
            ("127.0.0.1:7143", Some("http://127.0.0.1:8000"), "127.0.0.1:8000"),
            ("127.0.0.1:7143", Some("null"), "null"),
        ] {
            let problem = check(host, origin).expect_err(host);
            assert!(problem.contains(part), "{problem}");
        }
        assert!(check_names(&hosts, None, None).is_err());
    }
}
