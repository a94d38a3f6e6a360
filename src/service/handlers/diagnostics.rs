//! Methods about the daemon itself: its adapter, its statistics, and the failure tests.

use std::{future, ops::RangeInclusive, sync::Arc, time::Duration};

use tokio::{
    sync::{mpsc, watch},
    task,
    time::{MissedTickBehavior, interval},
};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status};

use super::{service::Service, stats};
use crate::{
    service::{
        frames::errors::{Refused, refused},
        network::{access::Caller, clients::ClientInfo},
        proto,
        wire::{diagnostics, refusals, scene},
    },
    verify, xr,
};

/// Default interval of statistics, s.
const INTERVAL_S: f64 = 1.0;
/// Range of the interval of statistics, s.
const INTERVALS_S: RangeInclusive<f64> = 0.1..=60.0;

#[tonic::async_trait]
impl proto::diagnostics_service_server::DiagnosticsService for Service {
    type VerifyStream = ReceiverStream<Result<proto::VerifyResult, Status>>;
    type WatchStatsStream = ReceiverStream<Result<proto::Stats, Status>>;

    async fn get_info(&self, request: Request<proto::GetInfoRequest>) -> Result<Response<proto::Info>, Status> {
        let role = Caller::from_request(&request)?.role();
        let frames = self.render.figures().frames.frames_rendered;
        let revision = self.render.scene().map_err(refused)?.revision;
        let mut info = diagnostics::info_to_pb(&self.adapter, self.stars, revision, frames);
        info.headset = self.headset.as_ref().map(|headset| stats::status_to_pb(headset));
        info.role = role.name().to_owned();
        Ok(Response::new(info))
    }

    async fn verify(&self, request: Request<proto::VerifyRequest>) -> Result<Response<Self::VerifyStream>, Status> {
        let request = request.into_inner();
        let non_empty = |text: String| Some(text).filter(|text| !text.is_empty());
        let checks = verify::select(non_empty(request.filter).as_deref())
            .map_err(|error| refusals::invalid(format!("filter: {error}")))?;
        let method = non_empty(request.star_method).map(|name| scene::star_method(&name)).transpose();
        let method = method.map_err(|problem| refusals::invalid(format!("star_method: {problem}")))?;
        let permit = Arc::clone(&self.verifying).try_acquire_owned();
        let permit =
            permit.map_err(|_| refusals::exhausted("checks", "another Verify call is running: try again later"))?;
        let (render, background_jobs) = (self.render.clone(), self.background_jobs.clone());
        let mut scenes = render.watch_scene();
        let (sender, stream) = mpsc::channel(1);
        let gone = sender.clone();
        task::spawn(async move {
            let _permit = permit;
            for check in checks {
                // Reserve room for the result first, so that no check runs for a client that does not read or has disconnected.
                let Ok(room) = sender.reserve().await else { return };
                let checked = async {
                    let result = background_jobs.verify(check, render.settings_of_checks(method)?).await?;
                    Ok(result.map_err(Status::internal))
                };
                let result = tokio::select! {
                    checked = checked => checked.map_err(refused).and_then(|result| result),
                    _ = scenes.wait_for(Option::is_none) => Err(refused(Refused::Ending)),
                    // The client disconnected: release the reserved room.
                    () = gone.closed() => return,
                };
                let failed = result.is_err();
                room.send(result.map(diagnostics::check_to_pb));
                if failed {
                    return;
                }
            }
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    async fn watch_stats(
        &self,
        request: Request<proto::WatchStatsRequest>,
    ) -> Result<Response<Self::WatchStatsStream>, Status> {
        let client = ClientInfo::from_request(&request)?;
        let interval_s = request.into_inner().interval_s.unwrap_or(INTERVAL_S);
        if !INTERVALS_S.contains(&interval_s) {
            let (min, max) = (INTERVALS_S.start(), INTERVALS_S.end());
            return Err(refusals::invalid(format!("interval_s = {interval_s}: must be between {min} and {max} s")));
        }
        let permit = self.watcher(&client)?;
        let mut scenes = self.render.watch_scene();
        if scenes.borrow().is_none() {
            return Err(refused(Refused::Ending));
        }
        let (render, headset, windows) = (self.render.clone(), self.headset.clone(), self.windows.clone());
        let (encoders, shares) = (Arc::clone(&self.encoders), Arc::clone(&self.shares));
        let cluster = self.cluster.clone();
        let mut statuses = headset.as_ref().map(|headset| headset.watch_status());
        let (sender, stream) = mpsc::channel(1);
        task::spawn(async move {
            let _permit = permit;
            let mut ticks = interval(Duration::from_secs_f64(interval_s));
            ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
            loop {
                tokio::select! {
                    _ = ticks.tick() => {}
                    () = changed(&mut statuses) => {}
                    () = sender.closed() => return,
                    _ = scenes.wait_for(Option::is_none) => return,
                }
                // A slow reader gets the newest statistics when there is room for them.
                let room = tokio::select! {
                    room = sender.reserve() => room,
                    _ = scenes.wait_for(Option::is_none) => return,
                };
                let Ok(room) = room else { return };
                let parts = (headset.as_deref(), windows.as_deref(), cluster.as_deref());
                room.send(Ok(stats::stats_to_pb(&render, parts, &encoders, &shares)));
            }
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

/// Waits for a change of the headset's status; without a headset, it never resolves.
async fn changed(statuses: &mut Option<watch::Receiver<xr::Status>>) {
    if let Some(statuses) = statuses
        && statuses.changed().await.is_ok()
    {
        return;
    }
    future::pending().await
}
