//! Layer that corrects the statuses of all answers: it makes them short enough for the headers of an answer, and gives them the documented code if a
//! request could not be read. Handlers and libraries create statuses in many places; all pass this layer, except those that
//! [`refused_call`](super::http_handler::refused_call) sends.

use std::{
    pin::Pin,
    task::{Context, Poll, ready},
};

use http::{HeaderMap, HeaderName, Request, Response};
use http_body::{Body as HttpBody, Frame, SizeHint};
use tonic::{Code, Status, body::Body, codegen::BoxFuture};
use tower_layer::Layer;
use tower_service::Service;

use crate::service::wire::refusals;

/// Header with the details of a status.
const DETAILS: HeaderName = HeaderName::from_static("grpc-status-details-bin");
/// Start of tonic's text for a message that is longer than allowed.
const TOO_LONG: &str = "Error, decoded message length too large: ";
/// Start of prost's text for a message that cannot be decoded.
const UNDECODABLE: &str = "failed to decode Protobuf message";

/// Changes the status of a request that could not be read to the documented code.
fn named(status: Status) -> Status {
    let text = status.message();
    match status.code() {
        Code::OutOfRange => match text.strip_prefix(TOO_LONG) {
            Some(sizes) => refusals::exhausted("message", format!("the message is too long: {sizes}")),
            None => status,
        },
        Code::Internal if text.starts_with(UNDECODABLE) => {
            let problem = format!("the request is not a message of this call: {text}");
            Status::invalid_argument(problem)
        }
        _ => status,
    }
}

/// Corrects the status in headers or trailers.
fn correct(headers: &mut HeaderMap) {
    let length = |name| headers.get(name).map_or(0, http::HeaderValue::len);
    let is_long = length(&Status::GRPC_MESSAGE) + length(&DETAILS) > refusals::MOST_ENCODED;
    let code = headers.get(Status::GRPC_STATUS).map(|code| Code::from_bytes(code.as_bytes()));
    if !is_long && !matches!(code, Some(Code::OutOfRange | Code::Internal)) {
        return;
    }
    let Some(status) = Status::from_header_map(headers) else { return };
    let corrected = refusals::bounded(named(status));
    headers.remove(Status::GRPC_MESSAGE);
    headers.remove(DETAILS);
    // The text is percent-encoded and the details are base64, so both are valid values of headers.
    let _ = corrected.add_header(headers);
}

/// See the module.
#[derive(Clone, Copy)]
pub(crate) struct CorrectStatuses;

impl<S> Layer<S> for CorrectStatuses {
    type Service = Corrected<S>;

    fn layer(&self, inner: S) -> Corrected<S> {
        Corrected { inner }
    }
}

/// See [`CorrectStatuses`].
#[derive(Clone)]
pub(crate) struct Corrected<S> {
    inner: S,
}

impl<S> Service<Request<Body>> for Corrected<S>
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
        let answer = self.inner.call(request);
        Box::pin(async move {
            let mut response = answer.await?;
            correct(response.headers_mut());
            Ok(response.map(|body| Body::new(CorrectedAnswer(body))))
        })
    }
}

fn corrected(frame: Frame<bytes::Bytes>) -> Frame<bytes::Bytes> {
    match frame.into_trailers() {
        Ok(mut trailers) => {
            correct(&mut trailers);
            Frame::trailers(trailers)
        }
        Err(data) => data,
    }
}

/// An answer whose trailers are corrected.
struct CorrectedAnswer(Body);

impl HttpBody for CorrectedAnswer {
    type Data = bytes::Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<bytes::Bytes>, Status>>> {
        let frame = ready!(Pin::new(&mut self.0).poll_frame(context));
        Poll::Ready(frame.map(|frame| frame.map(corrected)))
    }

    fn is_end_stream(&self) -> bool {
        self.0.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.0.size_hint()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    /// Returns a status after the correction, and the size of all headers, bytes.
    fn sent(status: &Status) -> (Status, usize) {
        let mut headers = HeaderMap::new();
        headers.insert(http::header::CONTENT_TYPE, http::HeaderValue::from_static("application/grpc"));
        status.add_header(&mut headers).unwrap();
        correct(&mut headers);
        assert_eq!(headers[http::header::CONTENT_TYPE], "application/grpc");
        let bytes = headers.values().map(http::HeaderValue::len).sum();
        (Status::from_header_map(&headers).unwrap(), bytes)
    }

    #[test]
    fn requests_that_cannot_be_read_have_the_documented_codes() {
        for (status, code, part) in [
            (Status::out_of_range(format!("{TOO_LONG}found 9 bytes")), Code::ResourceExhausted, "found 9 bytes"),
            (Status::internal(format!("{UNDECODABLE}: wire type")), Code::InvalidArgument, "wire type"),
            (Status::out_of_range("other"), Code::OutOfRange, "other"),
            (Status::internal("other"), Code::Internal, "other"),
            (Status::not_found("no view `\u{e4} %`"), Code::NotFound, "no view `\u{e4} %`"),
        ] {
            let (found, _) = sent(&status);
            assert!(found.code() == code && found.message().contains(part), "{found:?}");
        }
    }

    #[test]
    fn long_texts_of_any_origin_are_shortened() {
        for text in ["y".repeat(60_000), "\u{e4}".repeat(60_000), "a ".repeat(2000)] {
            let (found, bytes) = sent(&Status::internal(&text));
            assert!(bytes < refusals::MOST_ENCODED + 100, "{bytes}");
            assert_eq!(found.message().chars().next(), text.chars().next());
            assert_eq!(found.code(), Code::Internal);
        }
        let details = Status::with_details(Code::Aborted, "short", vec![7; 5000].into());
        let (found, _) = sent(&details);
        assert!((found.code(), found.message(), found.details().len()) == (Code::Aborted, "short", 0), "{found:?}");
    }
}
