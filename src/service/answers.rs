//! What is answered on the port of the calls, and is none: each of these stands before the calls and takes its own requests.

use tonic::{
    body::Body,
    codegen::{
        BoxFuture, Context, Poll, Service,
        http::{Request, Response},
    },
};
use tower_layer::Layer;

/// Answers requests of its own.
pub(super) trait Answers: Clone {
    /// The answer; `None`: the request is for those behind.
    fn answer(&self, request: &Request<Body>) -> Option<Response<Body>>;
}

/// Puts it before a service.
#[derive(Clone)]
pub(super) struct AnswersFirst<A>(pub(super) A);

impl<A: Answers, S> Layer<S> for AnswersFirst<A> {
    type Service = Answering<A, S>;

    fn layer(&self, inner: S) -> Answering<A, S> {
        Answering { answers: self.0.clone(), inner }
    }
}

/// See [`AnswersFirst`].
#[derive(Clone)]
pub(super) struct Answering<A, S> {
    answers: A,
    inner: S,
}

impl<A, S> Service<Request<Body>> for Answering<A, S>
where
    A: Answers,
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
