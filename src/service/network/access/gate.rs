//! Tower layer that authenticates every call and checks its role.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
};

use http::{HeaderValue, Request, Response, StatusCode, header};
use http_body::{Body as HttpBody, Frame, SizeHint};
use tokio::sync::watch;
use tonic::{Code, Status, body::Body, codegen::BoxFuture};
use tower_layer::Layer;
use tower_service::Service;
use tracing::Instrument;

use super::{
    Access, CallerCredentials, Rejection,
    roles::{Need, need},
};
use crate::{
    config::Role,
    service::{
        SPANS,
        network::{
            clients::ClientInfo,
            http_handler::{PLAIN, refused_call, text},
            log_summary::Kind,
        },
        scene::excerpts::excerpt,
        wire::refusals,
    },
};

/// Maximum length of a path in messages, bytes. The path of every call is shorter.
const MOST_PATH: usize = 128;

/// The authenticated caller of a request. Requests that need a role have it as an extension.
#[derive(Clone, Debug)]
pub(crate) struct Caller {
    pub(crate) name: Arc<str>,
    pub(super) role: Role,
    pub(super) credentials: CallerCredentials,
}

impl Caller {
    /// Returns the caller's role.
    pub(crate) fn role(&self) -> Role {
        self.role
    }

    /// Returns the caller of a request.
    ///
    /// # Errors
    ///
    /// The request did not come through the gate.
    pub(crate) fn from_request<T>(request: &tonic::Request<T>) -> Result<Self, Status> {
        let caller = request.extensions().get::<Self>().cloned();
        caller.ok_or_else(|| Status::internal("the call was not authenticated"))
    }
}

/// Layer that authenticates calls.
#[derive(Clone)]
pub(crate) struct Gate {
    access: watch::Receiver<Arc<Access>>,
    /// Reason why calls that change something are refused; `None` if they are accepted.
    led: Option<Arc<str>>,
}

impl Gate {
    pub(crate) fn new(access: watch::Receiver<Arc<Access>>, led: Option<Arc<str>>) -> Self {
        Self { access, led }
    }
}

impl<S> Layer<S> for Gate {
    type Service = Gated<S>;

    fn layer(&self, inner: S) -> Gated<S> {
        Gated { inner, access: self.access.clone(), led: self.led.clone() }
    }
}

/// Service behind the gate.
#[derive(Clone)]
pub(crate) struct Gated<S> {
    inner: S,
    access: watch::Receiver<Arc<Access>>,
    led: Option<Arc<str>>,
}

/// Authenticates a call that needs a role.
fn admit(access: &Access, client: &ClientInfo, request: &Request<Body>, least: Role) -> Result<Caller, Status> {
    let caller = access.credentials(client, request.headers()).and_then(|credentials| access.caller(credentials));
    let caller = caller.map_err(|turned| match turned {
        // Browsers and clients without credentials are frequent, so they are logged at a lower level.
        Rejection::Unknown(why) => Status::unauthenticated(why),
        Rejection::Refused(why) => {
            client.log(Kind::Denied, &format!("refused: {why}"));
            Status::unauthenticated(why)
        }
    })?;
    if caller.role < least {
        let Caller { name, role, .. } = &caller;
        let path = excerpt(request.uri().path(), MOST_PATH);
        let problem = format!("`{name}` has the role {role}, but {path} needs {least}");
        client.log(Kind::Denied, &format!("refused: {problem}"));
        return Err(refusals::denied(problem, &role.to_string(), &least.to_string()));
    }
    Ok(caller)
}

/// Returns a refusal in the caller's protocol: gRPC, gRPC-Web or plain HTTP.
fn refusal(request: &Request<Body>, status: &Status) -> Response<Body> {
    if let Some(response) = refused_call(request, status) {
        return response;
    }
    let code = if status.code() == Code::Unauthenticated { StatusCode::UNAUTHORIZED } else { StatusCode::FORBIDDEN };
    let mut response = text(code, PLAIN, format!("{}\n", status.message()));
    response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
    response
}

impl<S> Service<Request<Body>> for Gated<S>
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

    fn call(&mut self, mut request: Request<Body>) -> Self::Future {
        let Need::Role(least) = need(request.uri().path()) else { return Box::pin(self.inner.call(request)) };
        let Some(client) = request.extensions().get::<ClientInfo>().cloned() else {
            return Box::pin(async { Ok(Status::internal("the request has no connection").into_http()) });
        };
        let access = Arc::clone(&self.access.borrow());
        let caller = match admit(&access, &client, &request, least) {
            Ok(caller) => caller,
            Err(status) => {
                let response = refusal(&request, &status);
                return Box::pin(async { Ok(response) });
            }
        };
        if let Some(led) = self.led.as_ref().filter(|_| least > Role::View) {
            let response = refusal(&request, &Status::failed_precondition(&**led));
            return Box::pin(async { Ok(response) });
        }
        let credentials = caller.credentials;
        request.extensions_mut().insert(caller);
        let span = tracing::trace_span!(target: SPANS, "call", path = request.uri().path(), client = client.name());
        let answer = self.inner.call(request).instrument(span);
        if credentials == CallerCredentials::Nothing {
            return Box::pin(answer);
        }
        let newest = self.access.clone();
        let mut gone = Box::pin(no_longer(self.access.clone(), credentials, least));
        Box::pin(async move {
            // A call that only sends, such as a stream of poses, waits here for its answer.
            let response = tokio::select! {
                biased;
                why = &mut gone => return Ok(Status::unauthenticated(why).into_http()),
                response = answer => response?,
            };
            // Watchers get a change one after the other, so the access rules may have changed before this call notices it.
            if !is_let_in(&newest.borrow(), credentials, least) {
                return Ok(Status::unauthenticated(NO_LONGER).into_http());
            }
            Ok(response.map(|body| Body::new(GuardedAnswer { body: Some(body), gone })))
        })
    }
}

/// Message of a call that ends because its caller lost its role.
const NO_LONGER: &str = "the token or certificate of this call is no longer valid";

fn is_let_in(access: &Access, credentials: CallerCredentials, least: Role) -> bool {
    access.caller(credentials).is_ok_and(|caller| caller.role >= least)
}

/// Resolves when the caller's role is revoked.
async fn no_longer(
    mut access: watch::Receiver<Arc<Access>>,
    credentials: CallerCredentials,
    least: Role,
) -> &'static str {
    loop {
        if access.changed().await.is_err() {
            // The access rules can no longer change.
            std::future::pending::<()>().await;
        }
        let access = Arc::clone(&access.borrow_and_update());
        if !is_let_in(&access, credentials, least) {
            return NO_LONGER;
        }
    }
}

/// Body of an answer that ends when the caller's role is revoked.
struct GuardedAnswer<F> {
    /// `None` once it has ended.
    body: Option<Body>,
    gone: Pin<Box<F>>,
}

impl<F: Future<Output = &'static str>> HttpBody for GuardedAnswer<F> {
    type Data = bytes::Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<bytes::Bytes>, Status>>> {
        let Self { body: Some(body), gone } = &mut *self else { return Poll::Ready(None) };
        if let Poll::Ready(why) = gone.as_mut().poll(context) {
            self.body = None;
            let trailers = http::HeaderMap::from_iter([
                (Status::GRPC_STATUS, HeaderValue::from(Code::Unauthenticated as i32)),
                (Status::GRPC_MESSAGE, HeaderValue::from_static(why)),
            ]);
            return Poll::Ready(Some(Ok(Frame::trailers(trailers))));
        }
        Pin::new(body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.as_ref().is_none_or(HttpBody::is_end_stream)
    }

    fn size_hint(&self) -> SizeHint {
        self.body.as_ref().map_or_else(SizeHint::default, HttpBody::size_hint)
    }
}
