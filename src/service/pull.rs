//! Frames that clients ask for one by one: whoever asks for the next frame when it has shown the last one never sees an old picture, whatever
//! buffers lie between.

use std::{
    collections::HashSet,
    future::poll_fn,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use tokio::time::sleep;
use tonic::Status;

use super::{
    clients::{ClientInfo, Held},
    handlers::{Service, failed, refused},
    order::{Order, Reading},
    proto, refusals,
    slot::RenderedFrame,
    video::{Rate, Seen},
};

/// Views of one call.
const MOST_VIEWS: usize = 16;
/// How long the views of one frame may take to be handed out, one after the other.
const HANDING_OUT: Duration = Duration::from_millis(2);

type Rendered = Result<Arc<RenderedFrame>, Status>;
type Waiting = Pin<Box<dyn Future<Output = Rendered> + Send>>;

impl Service {
    fn pulled(&self, client: &ClientInfo, request: &proto::NextFrameRequest) -> Result<Order, Status> {
        let order = self.order(client, &request.view, request.encoding, request.max_size)?;
        Ok(Order { rate: Some(Rate::Pulled), ..order })
    }

    /// Waits for the next frame of an order's view.
    fn next_of(&self, order: &Order, after: u64) -> Result<Waiting, Status> {
        let subscription = match &order.headset {
            None => self.render.subscribe_after(order.view, order.wanted(), after),
            // Each of its frames shows another pose.
            Some(headset) => headset.subscribe(order.wanted(), Duration::ZERO),
        };
        let subscription = subscription.map_err(refused)?;
        Ok(Box::pin(async move {
            match subscription.next().await {
                Ok(Some((frame, _))) => Ok(frame),
                Ok(None) => Err(Status::unavailable("the daemon is shutting down")),
                Err(failure) => Err(failed(&failure)),
            }
        }))
    }

    /// The next frame of a view.
    pub(super) async fn pull(
        &self,
        client: &ClientInfo,
        request: &proto::NextFrameRequest,
    ) -> Result<(proto::Frame, Held), Status> {
        let order = self.pulled(client, request)?;
        let held = client.hold_output(order.most_bytes())?;
        let rendered = self.next_of(&order, request.after_frame_number)?.await?;
        let held = held.and(order.more_room(&rendered)?);
        Ok((order.encode(&rendered, read(request)).await?, held))
    }

    /// The next frames of several views: as soon as one of them has one, those of all that have.
    pub(super) async fn pull_several(
        &self,
        client: &ClientInfo,
        requests: &[proto::NextFrameRequest],
    ) -> Result<(Vec<proto::Frame>, Held), Status> {
        if requests.is_empty() || requests.len() > MOST_VIEWS {
            let problem = format!("views: 1 to {MOST_VIEWS} are allowed in one call, these are {}", requests.len());
            return Err(refusals::invalid(problem));
        }
        let mut orders = Vec::new();
        let mut asked = HashSet::new();
        for request in requests {
            let order = self.pulled(client, request)?;
            if !asked.insert((order.name.clone(), order.form.encoding)) {
                let encoding = order.form.encoding.name();
                return Err(refusals::invalid(format!("views: `{}` is there twice as {encoding}", order.name)));
            }
            orders.push((order, request));
        }
        let mut held = client.hold_output(orders.iter().map(|(order, _)| order.most_bytes()).sum())?;
        let waiting = orders.iter().map(|(order, request)| Ok(Some(self.next_of(order, request.after_frame_number)?)));
        let mut waiting: Vec<Option<Waiting>> = waiting.collect::<Result<_, Status>>()?;
        let mut got: Vec<(usize, Rendered)> = poll_fn(|context| match ready_ones(&mut waiting, context) {
            got if got.is_empty() => Poll::Pending,
            got => Poll::Ready(got),
        })
        .await;
        // The others of the same frame follow at once.
        if waiting.iter().any(Option::is_some) {
            sleep(HANDING_OUT).await;
            got.extend(poll_fn(|context| Poll::Ready(ready_ones(&mut waiting, context))).await);
        }
        got.sort_by_key(|(number, _)| *number);
        let mut frames = Vec::new();
        for (number, rendered) in got {
            let ((order, request), rendered) = (&orders[number], rendered?);
            held = held.and(order.more_room(&rendered)?);
            frames.push(order.encode(&rendered, read(request)).await?);
        }
        Ok((frames, held))
    }
}

/// What a reader has by its own words.
fn read(request: &proto::NextFrameRequest) -> Reading {
    Reading { seen: Seen::of(request.video, request.after_frame_number), ..Reading::default() }
}

/// Those that have a frame by now; they wait no more.
fn ready_ones(waiting: &mut [Option<Waiting>], context: &mut Context<'_>) -> Vec<(usize, Rendered)> {
    let mut got = Vec::new();
    for (number, waits) in waiting.iter_mut().enumerate() {
        if let Some(Poll::Ready(rendered)) = waits.as_mut().map(|waits| waits.as_mut().poll(context)) {
            *waits = None;
            got.push((number, rendered));
        }
    }
    got
}
