//! Draws the frames of cues ([`crate::service::engine::led`]): the worker's share of the views, with everything that the director has decided.

use std::{sync::Arc, time::Instant};

use tokio::sync::oneshot;

use super::{
    MOST_IN_FLIGHT, Worker,
    job::{Cued, Job},
};
use crate::{
    render::Wanted,
    service::{
        engine::{
            interface::EngineError,
            led::{Cue, CueError, CueRequest, LedFrame, Pictures},
            shared_state::Request,
        },
        frames::{errors::RenderFailure, rendered_frame::RenderedFrame, schedule::Pace},
        scene::views::ViewId,
    },
};

/// The frame of a job that has not arrived yet, and its images.
struct Waiting {
    frame: oneshot::Receiver<Result<Arc<RenderedFrame>, RenderFailure>>,
    views: Vec<(ViewId, Wanted)>,
}

impl Worker {
    /// Draws all frames of a cue, waits for them, and replies. An error means that the engine is lost for good.
    pub(super) fn draw_cue(&mut self, CueRequest { cue, reply }: CueRequest) -> Result<(), EngineError> {
        let start = Instant::now();
        let jobs = match self.jobs_of(&cue, start) {
            Ok(jobs) => jobs,
            Err(error) => {
                reply(Err(error));
                return Ok(());
            }
        };
        let mut waiting = Vec::with_capacity(jobs.len());
        for (job, waits) in jobs {
            while self.in_flight.len() >= MOST_IN_FLIGHT {
                self.finish()?;
            }
            waiting.push(waits);
            self.begin(job)?;
        }
        while !self.in_flight.is_empty() {
            self.finish()?;
        }
        let arrived = waiting.into_iter().map(|Waiting { mut frame, views }| match frame.try_recv() {
            Ok(Ok(frame)) => Ok(LedFrame { frame, views }),
            Ok(Err(failure)) => Err(CueError::Frame(failure.to_string())),
            // The renderer was lost with this frame.
            Err(_) => Err(CueError::Frame(RenderFailure::Ended.to_string())),
        });
        let frames = arrived.collect::<Result<Vec<_>, CueError>>();
        reply(frames.map(|frames| Pictures { frames, start }));
        Ok(())
    }

    /// Returns the frames of a cue: one per group with views of this worker, and one more if clients want HDR images that need a separate frame.
    fn jobs_of(&mut self, cue: &Cue, start: Instant) -> Result<Vec<(Job, Waiting)>, CueError> {
        let shared = Arc::clone(&self.shared);
        let mut state = shared.state();
        let scene = state.scene.newest.clone();
        if scene.revision != cue.scene {
            return Err(CueError::Scene { wanted: cue.scene, found: scene.revision });
        }
        self.keep_groups(&scene, cue.level);
        let groups = Arc::clone(&self.groups);
        if groups.all.len() != cue.ev100.len() {
            return Err(CueError::Exposures { wanted: groups.all.len(), found: cue.ev100.len() });
        }
        // Requests of a lost frame that was drawn again.
        state.queue.requests.retain(|request| !request.reply.is_closed());
        state.camera.newest = cue.camera;
        state.camera.pose_time = state.time.now();
        state.tell_camera();
        let names = state.led.as_ref().map(|led| Arc::clone(&led.views)).unwrap_or_default();
        let own: Vec<ViewId> = names.iter().filter_map(|name| Some(scene.views.named(name)?.0)).collect();
        let hdr = state.wanted_by_clients();
        let mut jobs = Vec::new();
        for group in 0..groups.all.len() {
            let ids: Vec<ViewId> = groups.all[group].views.iter().map(|view| scene.views.ids()[*view]).collect();
            let of_own = |what: &dyn Fn(ViewId) -> Wanted| -> Vec<Wanted> {
                ids.iter().map(|id| if own.contains(id) { what(*id) } else { Wanted::default() }).collect()
            };
            let hdr_of = |id: ViewId| {
                let mut all = Wanted::default();
                hdr.iter().filter(|(of, _)| *of == id).for_each(|(_, wanted)| all |= *wanted);
                all
            };
            let kinds = if groups.apart[group] {
                vec![of_own(&|_| Wanted::display()), of_own(&hdr_of)]
            } else {
                let both = |id| {
                    let mut both = Wanted::display();
                    both |= hdr_of(id);
                    both
                };
                vec![of_own(&both)]
            };
            for wanted in kinds.into_iter().filter(|wanted| wanted.iter().any(|wanted| *wanted != Wanted::default())) {
                let views = ids.iter().copied().zip(wanted.iter().copied());
                let views: Vec<(ViewId, Wanted)> = views.filter(|(_, wanted)| *wanted != Wanted::default()).collect();
                let (reply, frame) = oneshot::channel();
                let (view, of_view) = views[0];
                let request = Request {
                    view,
                    wanted: of_view,
                    pace: Pace::new(std::time::Duration::ZERO),
                    of_windows: true,
                    reply,
                };
                let job = Job {
                    requests: vec![request],
                    subscribers: Vec::new(),
                    wanted,
                    groups: Arc::clone(&groups),
                    group,
                    camera: cue.camera,
                    pose_time: state.camera.pose_time,
                    step: cue.number,
                    time_s: cue.time_s,
                    objects: Arc::clone(&scene.objects.drawn),
                    stars: Arc::clone(&self.scene.stars),
                    scene: scene.clone(),
                    start,
                    cued: Some(Cued { number: cue.number, ev100: f64::from(cue.ev100[group]), rests: cue.rests }),
                };
                jobs.push((job, Waiting { frame, views }));
            }
        }
        Ok(jobs)
    }
}
