//! Plain HTTP requests on the port of the gRPC calls: each handler answers its requests before they reach the calls.

use tonic::{
    Status,
    body::Body,
    codegen::{
        BoxFuture, Context, Poll, Service,
        http::{HeaderValue, Request, Response, StatusCode, header},
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

/// Media type of plain text.
pub(crate) const PLAIN: &str = "text/plain; charset=utf-8";

/// Returns an answer with a text.
pub(crate) fn text(status: StatusCode, kind: &'static str, text: String) -> Response<Body> {
    let mut response = Response::new(Body::new(text));
    *response.status_mut() = status;
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    response
}

/// Returns a refusal in the protocol of a call, gRPC or gRPC-Web; `None`: the request is plain HTTP.
pub(crate) fn refused_call(request: &Request<Body>, status: &Status) -> Option<Response<Body>> {
    let kind = request.headers().get(header::CONTENT_TYPE)?;
    kind.as_bytes().starts_with(b"application/grpc").then(|| {
        let mut response = status.clone().into_http();
        response.headers_mut().insert(header::CONTENT_TYPE, kind.clone());
        response
    })
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
