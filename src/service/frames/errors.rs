//! Reasons for a missing frame, and the status of a call for each.

use tonic::Status;

use crate::service::wire::refusals;

/// Reasons why a request for a frame is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Refused {
    /// The queue is full.
    Full,
    /// The maximum number of subscribers is reached.
    Subscribers(usize),
    /// The view was deleted.
    Deleted,
    /// There is no headset, for this reason.
    Headset(String),
    /// The daemon is shutting down.
    Ending,
}

/// Reasons for a missing frame.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum RenderFailure {
    /// The engine failed.
    #[error("the frame could not be rendered: {0}")]
    Engine(String),
    /// There is no headset, or the session has ended.
    #[error("the headset shows no frames: {0}")]
    Headset(String),
    /// The view was deleted.
    #[error("view `{0}` was deleted")]
    Deleted(String),
    /// The render thread has ended, or accepts no more work.
    #[error("the daemon is shutting down")]
    Ended,
}

/// Returns the status of a call whose request was refused.
pub(crate) fn refused(refused: Refused) -> Status {
    match refused {
        Refused::Full => refusals::exhausted("frames", "too many RenderFrame calls are waiting: try again later"),
        Refused::Subscribers(most) => {
            refusals::exhausted("streams", format!("there are already {most} streams, the maximum: end one first"))
        }
        Refused::Deleted => Status::not_found("the view was deleted in the meantime"),
        Refused::Headset(reason) => failed(&RenderFailure::Headset(reason)),
        Refused::Ending => Status::unavailable("the daemon is shutting down"),
    }
}

/// Returns the status of a call whose frame could not be rendered.
pub(crate) fn failed(failure: &RenderFailure) -> Status {
    match failure {
        RenderFailure::Deleted(name) => refusals::absent("view", name, failure.to_string()),
        RenderFailure::Engine(_) => Status::internal(failure.to_string()),
        RenderFailure::Headset(_) | RenderFailure::Ended => Status::unavailable(failure.to_string()),
    }
}
