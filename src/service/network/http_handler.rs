//! Plain HTTP requests on the port of the gRPC calls: each handler answers its requests before they reach the calls.

use tonic::{
    Status,
    body::Body,
    codegen::{
        BoxFuture, Context, Poll, Service,
        http::{HeaderValue, Method, Request, Response, StatusCode, Version, header},
    },
};
use tower_layer::Layer;

use crate::service::wire::refusals;

/// Path of the metrics.
pub(crate) const METRICS: &str = "/metrics";
/// Path of the health.
pub(crate) const HEALTH: &str = "/healthz";

/// Whether a path is one that monitoring requests again and again.
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

/// Media type of calls. The media types of gRPC-Web begin with it too.
const GRPC: &[u8] = b"application/grpc";
/// Start of the media types of gRPC-Web.
const GRPC_WEB: &[u8] = b"application/grpc-web";
/// Methods of the page, of the metrics and of the health.
const READS: HeaderValue = HeaderValue::from_static("GET, HEAD");
/// Method of calls.
const CALLS: HeaderValue = HeaderValue::from_static("POST");

/// Returns the media type of a call, gRPC or gRPC-Web; `None`: the request is plain HTTP.
fn call_type(request: &Request<Body>) -> Option<&HeaderValue> {
    request.headers().get(header::CONTENT_TYPE).filter(|kind| kind.as_bytes().starts_with(GRPC))
}

/// Returns a refusal in the protocol of a call, gRPC or gRPC-Web; `None`: the request is plain HTTP.
pub(crate) fn refused_call(request: &Request<Body>, status: &Status) -> Option<Response<Body>> {
    let kind = call_type(request)?;
    let mut response = refusals::bounded(status.clone()).into_http();
    response.headers_mut().insert(header::CONTENT_TYPE, kind.clone());
    Some(response)
}

/// Returns the answer to a request that is neither for a file nor a call, because of its method or its version of HTTP; `None` if it may be a call.
pub(crate) fn misdirected(request: &Request<Body>) -> Option<Response<Body>> {
    let is_http2 = request.version() == Version::HTTP_2;
    let path = request.uri().path();
    let is_call_path = path.starts_with("/steradian.") || path.starts_with("/grpc.");
    match call_type(request) {
        Some(kind) if is_http2 || kind.as_bytes().starts_with(GRPC_WEB) => None,
        Some(_) => {
            let problem = "gRPC needs HTTP/2, but this request came over HTTP/1.1: a proxy must pass calls on with HTTP/2 (nginx: \
                           grpc_pass instead of proxy_pass); gRPC-Web works over both\n";
            Some(text(StatusCode::HTTP_VERSION_NOT_SUPPORTED, PLAIN, problem.to_owned()))
        }
        None if is_call_path && request.method() == Method::POST => {
            let problem = "calls have the content type application/grpc or application/grpc-web\n";
            (!is_http2).then(|| text(StatusCode::UNSUPPORTED_MEDIA_TYPE, PLAIN, problem.to_owned()))
        }
        None => {
            let allowed = if is_call_path { CALLS } else { READS };
            let problem = format!("the method {} is not allowed here\n", request.method());
            let mut response = text(StatusCode::METHOD_NOT_ALLOWED, PLAIN, problem);
            response.headers_mut().insert(header::ALLOW, allowed);
            Some(response)
        }
    }
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
