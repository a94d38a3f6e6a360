//! Frames on request: a client that requests the next frame only after it has shown the last one never gets an outdated image, whatever buffers are
//! between it and the daemon.

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

use super::service::Service;
use crate::service::{
    frames::{
        errors::{failed, refused},
        image_encoding::{ImageRequest, ReaderState},
        rendered_frame::RenderedFrame,
        video::{LastPicture, Rate},
    },
    network::clients::{ClientInfo, Held},
    proto,
    wire::refusals,
};

/// Maximum number of views in a call.
const MOST_VIEWS: usize = 16;
/// Time within which the images of one frame are delivered for several views.
const HANDING_OUT: Duration = Duration::from_millis(2);

type Rendered = Result<Arc<RenderedFrame>, Status>;
type Waiting = Pin<Box<dyn Future<Output = Rendered> + Send>>;

impl Service {
    fn pulled(&self, client: &ClientInfo, request: &proto::NextFrameRequest) -> Result<ImageRequest, Status> {
        let image_request = self.image_request(client, &request.view, request.encoding, request.max_size)?;
        Ok(ImageRequest { rate: Some(Rate::Pulled), ..image_request })
    }

    /// Waits for the next frame of a request's view.
    fn next_of(&self, image_request: &ImageRequest, after: u64) -> Result<Waiting, Status> {
        let place = image_request.client.stream()?;
        let subscription = match self.headset_of(image_request.view) {
            None => self.render.subscribe_after(image_request.view, image_request.wanted(), after),
            // Each frame of a headset has a new pose, so every frame is a next one.
            Some(headset) => headset.subscribe(image_request.wanted(), Duration::ZERO),
        };
        let subscription = subscription.map_err(refused)?;
        Ok(Box::pin(async move {
            let _place = place;
            match subscription.next().await {
                Ok(Some((frame, _))) => Ok(frame),
                Ok(None) => Err(Status::unavailable("the daemon is shutting down")),
                Err(failure) => Err(failed(&failure)),
            }
        }))
    }

    /// Returns the next frame of a view.
    pub(crate) async fn pull(
        &self,
        client: &ClientInfo,
        request: &proto::NextFrameRequest,
    ) -> Result<(proto::Frame, Held), Status> {
        let image_request = self.pulled(client, request)?;
        let held = client.hold_output(image_request.most_bytes())?;
        let rendered = self.next_of(&image_request, request.after_frame_number)?.await?;
        let held = held.and(image_request.reserve_more(&rendered)?);
        Ok((image_request.encode(&rendered, read(request)).await?, held))
    }

    /// Waits until the next frame of one of several views is ready, and returns the frames of all views that are ready at that time.
    pub(crate) async fn pull_several(
        &self,
        client: &ClientInfo,
        requests: &[proto::NextFrameRequest],
    ) -> Result<(Vec<proto::Frame>, Held), Status> {
        if requests.is_empty() || requests.len() > MOST_VIEWS {
            let problem =
                format!("views: there must be between 1 and {MOST_VIEWS} in one call, not {}", requests.len());
            return Err(refusals::invalid(problem));
        }
        let mut image_requests = Vec::new();
        let mut asked = HashSet::new();
        for request in requests {
            let image_request = self.pulled(client, request)?;
            if !asked.insert((image_request.name.clone(), image_request.form.encoding)) {
                let encoding = image_request.form.encoding.name();
                return Err(refusals::invalid(format!(
                    "views: `{}` is named twice with the encoding {encoding}",
                    image_request.name
                )));
            }
            image_requests.push((image_request, request));
        }
        let mut held =
            client.hold_output(image_requests.iter().map(|(image_request, _)| image_request.most_bytes()).sum())?;
        let waiting = image_requests
            .iter()
            .map(|(image_request, request)| Ok(Some(self.next_of(image_request, request.after_frame_number)?)));
        let mut waiting: Vec<Option<Waiting>> = waiting.collect::<Result<_, Status>>()?;
        let mut got: Vec<(usize, Rendered)> = poll_fn(|context| match ready_ones(&mut waiting, context) {
            got if got.is_empty() => Poll::Pending,
            got => Poll::Ready(got),
        })
        .await;
        // The other views of the same frame follow within this time.
        if waiting.iter().any(Option::is_some) {
            sleep(HANDING_OUT).await;
            got.extend(poll_fn(|context| Poll::Ready(ready_ones(&mut waiting, context))).await);
        }
        got.sort_by_key(|(number, _)| *number);
        let mut frames = Vec::new();
        for (number, rendered) in got {
            let ((image_request, request), rendered) = (&image_requests[number], rendered?);
            held = held.and(image_request.reserve_more(&rendered)?);
            frames.push(image_request.encode(&rendered, read(request)).await?);
        }
        Ok((frames, held))
    }
}

/// Returns the reader's state from its request.
fn read(request: &proto::NextFrameRequest) -> ReaderState {
    ReaderState { seen: LastPicture::from_numbers(request.video, request.after_frame_number), ..ReaderState::default() }
}

/// Removes and returns the frames that are ready.
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
