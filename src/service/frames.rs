//! The stream of frames of one subscriber. A frame is taken from the slot only when the connection asks for the next
//! message, and those on their way have been acknowledged but for two, so what a client gets is the newest frame at that moment. Without
//! acknowledgements what lies in the buffers of the connection is not known here.

use std::{
    pin::Pin,
    task::{Context, Poll, ready},
};

use tokio_stream::Stream;
use tonic::Status;

use super::{
    handlers::failed,
    order::{Order, Reading},
    proto,
    room::Room,
    streams::{Acknowledged, Subscription},
    video::Seen,
};

/// What a stream holds between two messages.
pub(super) struct Source {
    pub(super) subscription: Subscription,
    /// `None`: frames are not acknowledged.
    pub(super) acknowledged: Option<Acknowledged>,
    /// The last picture of video.
    pub(super) seen: Option<Seen>,
    pub(super) room: Room,
}

/// The work on the next message; it owns the source meanwhile and hands it back.
type Work = Pin<Box<dyn Future<Output = Option<(Result<proto::Frame, Status>, Option<Source>)>> + Send>>;

/// See the module.
pub(super) struct FrameStream {
    order: Order,
    /// `None` after the end.
    work: Option<Work>,
}

impl FrameStream {
    pub(super) fn new(source: Source, order: Order) -> Self {
        let work = Some(next(source, order.clone()));
        Self { order, work }
    }
}

fn next(mut source: Source, order: Order) -> Work {
    Box::pin(async move {
        if let Some(acknowledged) = &mut source.acknowledged {
            // At the end of the daemon no acknowledgement gets through any more.
            tokio::select! {
                () = acknowledged.room() => {}
                () = source.subscription.ended() => {}
            }
        }
        let (rendered, dropped) = match source.subscription.next().await {
            Ok(Some(frame)) => frame,
            Ok(None) => return None,
            Err(failure) => return Some((Err(failed(&failure)), None)),
        };
        if let Err(status) = source.room.fit(&order, &rendered) {
            return Some((Err(status), None));
        }
        let stream = source.acknowledged.as_ref().map_or(0, Acknowledged::number);
        match order.encode(&rendered, Reading { dropped, stream, seen: source.seen }).await {
            Ok(message) => {
                source.seen = Seen::of(message.video, message.frame_number);
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
        self.work = source.map(|source| next(source, self.order.clone()));
        Poll::Ready(Some(item))
    }
}
