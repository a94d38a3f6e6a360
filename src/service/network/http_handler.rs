//! Plain HTTP requests on the port of the gRPC calls: each handler answers its requests before they reach the calls.

use tonic::{
    body::Body,
    codegen::{
        BoxFuture, Context, Poll, Service,
        http::{Request, Response},
    },
};
use tower_layer::Layer;

/// Path of the metrics.
pub(crate) const METRICS: &str = "/metrics";
/// Path of the health.
pub(crate) const HEALTH: &str = "/healthz";

/// Whether a path is requested again and again by monitoring.
pub(crate) fn is_monitoring(path: &str) -> bool {
    [METRICS, HEALTH].contains(&path)
}

/// Answers some of the requests.
pub(crate) trait HttpHandler: Clone {
    /// Returns the answer; `None` passes the request on.
    fn answer(&self, request: &Request<Body>) -> Option<Response<Body>>;
}

/// Layer that puts a handler before a service.
#[derive(Clone)]
pub(crate) struct HandleFirst<A>(pub(crate) A);

impl<A: HttpHandler, S> Layer<S> for HandleFirst<A> {
    type Service = Handling<A, S>;

    fn layer(&self, inner: S) -> Handling<A, S> {
        Handling { answers: self.0.clone(), inner }
    }
}

/// See [`HandleFirst`].
#[derive(Clone)]
pub(crate) struct Handling<A, S> {
    answers: A,
    inner: S,
}

impl<A, S> Service<Request<Body>> for Handling<A, S>
where
    A: HttpHandler,
    S: Service<Request<Body>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = BoxFuture<Self::Response, Self::Error>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        match self.answers.answer(&request) {
            Some(response) => Box::pin(async { Ok(response) }),
            None => Box::pin(self.inner.call(request)),
        }
    }
}
