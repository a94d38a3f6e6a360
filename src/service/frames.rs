//! The stream of frames of one subscriber. A frame is taken from the slot only when the connection asks for the next
//! message, so what a client gets is the newest frame at that moment, and nothing queues up for one that reads slowly.

use std::{
    pin::Pin,
    task::{Context, Poll, ready},
};

use tokio_stream::Stream;
use tonic::Status;

use super::{
    handlers::{Order, failed},
    proto,
    streams::Subscription,
};

/// The work on the next message; it owns the subscription meanwhile and hands it back.
type Work = Pin<Box<dyn Future<Output = Option<(Result<proto::Frame, Status>, Option<Subscription>)>> + Send>>;

/// See the module.
pub(super) struct FrameStream {
    order: Order,
    /// `None` after the end.
    work: Option<Work>,
}

impl FrameStream {
    pub(super) fn new(subscription: Subscription, order: Order) -> Self {
        let work = Some(next(subscription, order.clone()));
        Self { order, work }
    }
}

fn next(subscription: Subscription, order: Order) -> Work {
    Box::pin(async move {
        let (rendered, dropped) = match subscription.next().await {
            Ok(Some(frame)) => frame,
            Ok(None) => return None,
            Err(failure) => return Some((Err(failed(&failure)), None)),
        };
        match order.encode(rendered, dropped).await {
            Ok(message) => Some((Ok(message), Some(subscription))),
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
        let Some((item, subscription)) = done else { return Poll::Ready(None) };
        self.work = subscription.map(|subscription| next(subscription, self.order.clone()));
        Poll::Ready(Some(item))
    }
}
