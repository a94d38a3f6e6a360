//! The layer that asks every call who makes it.

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
    Access, Shown, Turned,
    roles::{Need, need},
};
use crate::{
    config::Role,
    service::{SPANS, clients::ClientInfo, refusals},
};

/// Who makes a call; every call that needs somebody carries it.
#[derive(Clone, Debug)]
pub(in crate::service) struct Caller {
    pub(in crate::service) name: Arc<str>,
    pub(super) role: Role,
    pub(super) shown: Shown,
}

impl Caller {
    /// Who makes a call.
    ///
    /// # Errors
    ///
    /// It did not come through the gate.
    pub(in crate::service) fn of<T>(request: &tonic::Request<T>) -> Result<Self, Status> {
        let caller = request.extensions().get::<Self>().cloned();
        caller.ok_or_else(|| Status::internal("nobody was asked who makes this call"))
    }
}

/// Asks every call who makes it.
#[derive(Clone)]
pub(in crate::service) struct Gate {
    access: watch::Receiver<Arc<Access>>,
}

impl Gate {
    pub(in crate::service) fn new(access: watch::Receiver<Arc<Access>>) -> Self {
        Self { access }
    }
}

impl<S> Layer<S> for Gate {
    type Service = Gated<S>;

    fn layer(&self, inner: S) -> Gated<S> {
        Gated { inner, access: self.access.clone() }
    }
}

/// Calls behind the gate.
#[derive(Clone)]
pub(in crate::service) struct Gated<S> {
    inner: S,
    access: watch::Receiver<Arc<Access>>,
}

/// Who makes a call that needs a role.
fn admit(access: &Access, client: &ClientInfo, request: &Request<Body>, least: Role) -> Result<Caller, Status> {
    let caller = access.shown(client, request.headers()).and_then(|shown| access.caller(shown));
    let caller = caller.map_err(|turned| match turned {
        // Browsers and clients that are not set up come so all the time.
        Turned::Unknown(why) => Status::unauthenticated(why),
        Turned::Refused(why) => {
            tracing::warn!(client = client.name(), "refused: {why}");
            Status::unauthenticated(why)
        }
    })?;
    if caller.role < least {
        let Caller { name, role, .. } = &caller;
        let path = request.uri().path();
        tracing::warn!(client = client.name(), "refused: `{name}` has the role {role}, {path} needs {least}");
        let problem = format!("`{name}` has the role {role}, and {path} needs {least}");
        return Err(refusals::denied(problem, &role.to_string(), &least.to_string()));
    }
    Ok(caller)
}

/// A refusal in the words of who asks: gRPC, gRPC-Web or a browser.
fn refusal(request: &Request<Body>, status: Status) -> Response<Body> {
    let kind =
        request.headers().get(header::CONTENT_TYPE).filter(|kind| kind.as_bytes().starts_with(b"application/grpc"));
    if let Some(kind) = kind {
        let mut response = status.into_http();
        response.headers_mut().insert(header::CONTENT_TYPE, kind.clone());
        return response;
    }
    let mut response = Response::new(Body::new(format!("{}\n", status.message())));
    *response.status_mut() =
        if status.code() == Code::Unauthenticated { StatusCode::UNAUTHORIZED } else { StatusCode::FORBIDDEN };
    let headers = response.headers_mut();
    headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
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
                let response = refusal(&request, status);
                return Box::pin(async { Ok(response) });
            }
        };
        let shown = caller.shown;
        request.extensions_mut().insert(caller);
        let span = tracing::trace_span!(target: SPANS, "call", path = request.uri().path(), client = client.name());
        let answer = self.inner.call(request).instrument(span);
        if shown == Shown::Nothing {
            return Box::pin(answer);
        }
        let newest = self.access.clone();
        let mut gone = Box::pin(no_longer(self.access.clone(), shown, least));
        Box::pin(async move {
            // Calls that only send, as poses of a camera, last before they are answered.
            let response = tokio::select! {
                biased;
                why = &mut gone => return Ok(Status::unauthenticated(why).into_http()),
                response = answer => response?,
            };
            // Those who wait are told of a change one after the other: it may be there before this call hears of it.
            if !is_let_in(&newest.borrow(), shown, least) {
                return Ok(Status::unauthenticated(NO_LONGER).into_http());
            }
            Ok(response.map(|body| Body::new(GuardedAnswer { body: Some(body), gone })))
        })
    }
}

/// Why a call ends whose caller has lost its role.
const NO_LONGER: &str = "what this call began with, a token or a certificate, is no longer of use";

fn is_let_in(access: &Access, shown: Shown, least: Role) -> bool {
    access.caller(shown).is_ok_and(|caller| caller.role >= least)
}

/// Waits until who shows this no longer has a role.
async fn no_longer(mut access: watch::Receiver<Arc<Access>>, shown: Shown, least: Role) -> &'static str {
    loop {
        if access.changed().await.is_err() {
            // There will be no other any more.
            std::future::pending::<()>().await;
        }
        let access = Arc::clone(&access.borrow_and_update());
        if !is_let_in(&access, shown, least) {
            return NO_LONGER;
        }
    }
}

/// An answer that ends when its caller is no longer let in.
struct GuardedAnswer<F> {
    /// Gone once it has been ended.
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
