//! The stream of frames of one subscriber. It takes a frame only when the connection requests the next message and all
//! but one of the sent frames are acknowledged, so a client gets the newest frame at that moment. Without
//! acknowledgements, frames may also wait in the buffers of the connection, which this module cannot see.

use std::{
    pin::Pin,
    task::{Context, Poll, ready},
};

use tokio::sync::OwnedSemaphorePermit;
use tokio_stream::Stream;
use tonic::Status;

use super::{
    errors::failed,
    image_encoding::{ImageRequest, ReaderState},
    stream_budget::StreamBudget,
    subscriptions::{Acknowledged, Subscription},
    video::LastPicture,
};
use crate::service::proto;

/// State of a stream between two messages.
pub(crate) struct Source {
    pub(crate) subscription: Subscription,
    /// `None`: the client does not acknowledge frames.
    pub(crate) acknowledged: Option<Acknowledged>,
    /// The last video picture that was sent.
    pub(crate) seen: Option<LastPicture>,
    pub(crate) budget: StreamBudget,
    /// Place that the stream takes among the streams of the client.
    pub(crate) _place: OwnedSemaphorePermit,
}

/// Future of the next message; it owns the source and hands it back.
type Work = Pin<Box<dyn Future<Output = Option<(Result<proto::Frame, Status>, Option<Source>)>> + Send>>;

/// Stream of encoded frames: see the module documentation.
pub(crate) struct FrameStream {
    image_request: ImageRequest,
    /// `None` after the end.
    work: Option<Work>,
}

impl FrameStream {
    pub(crate) fn new(source: Source, image_request: ImageRequest) -> Self {
        let work = Some(next(source, image_request.clone()));
        Self { image_request, work }
    }
}

fn next(mut source: Source, image_request: ImageRequest) -> Work {
    Box::pin(async move {
        if let Some(acknowledged) = &mut source.acknowledged {
            // When the daemon ends, acknowledgements no longer arrive.
            tokio::select! {
                () = acknowledged.ready() => {}
                () = source.subscription.ended() => {}
            }
        }
        let (rendered, dropped) = match source.subscription.next().await {
            Ok(Some(frame)) => frame,
            Ok(None) => return None,
            Err(failure) => return Some((Err(failed(&failure)), None)),
        };
        if let Err(status) = source.budget.fit(&image_request, &rendered) {
            return Some((Err(status), None));
        }
        let stream = source.acknowledged.as_ref().map_or(0, Acknowledged::number);
        match image_request.encode(&rendered, ReaderState { dropped, stream, seen: source.seen }).await {
            Ok(message) => {
                source.seen = LastPicture::from_numbers(message.video, message.frame_number);
                if let Some(acknowledged) = &mut source.acknowledged {
                    acknowledged.sent(message.frame_number);
                }
                Some((Ok(message), Some(source)))
            }
            Err(status) => Some((Err(status), None)),
        }
    })
}

impl Stream for FrameStream {
    type Item = Result<proto::Frame, Status>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let Some(work) = self.work.as_mut() else { return Poll::Ready(None) };
        let done = ready!(work.as_mut().poll(context));
        self.work = None;
        let Some((item, source)) = done else { return Poll::Ready(None) };
        self.work = source.map(|source| next(source, self.image_request.clone()));
        Poll::Ready(Some(item))
    }
}
