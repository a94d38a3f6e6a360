//! The health of the daemon at `/healthz`, and metrics for Prometheus at `/metrics`, in the text format of OpenMetrics 1.0. They are the values of
//! `WatchStats`, read on request.

use std::sync::{Arc, atomic::AtomicU64};

use prometheus_client::{
    encoding::text::encode,
    metrics::{
        counter::ConstCounter,
        family::Family,
        gauge::{ConstGauge, Gauge},
    },
    registry::{Registry, Unit},
};
use tokio::sync::watch;
use tonic::{
    body::Body,
    codegen::http::{Method, Request, Response, StatusCode},
};

use super::service::Service;
use crate::{
    platform::process,
    service::{
        cluster::figures::{ClusterFigures, Times},
        network::{
            access::Access,
            http_handler::{HEALTH, HttpHandler, METRICS, PLAIN, text},
        },
    },
    xr,
};

/// Media type of the text format.
const TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Answers GET and HEAD of `/metrics` and `/healthz`.
#[derive(Clone)]
pub(crate) struct Metrics {
    pub(crate) service: Service,
    pub(crate) access: watch::Receiver<Arc<Access>>,
}

impl Metrics {
    fn metrics(&self) -> Response<Body> {
        let mut all = registry(&self.service);
        if let Some(validity) = self.access.borrow().certificate_validity {
            all.register_with_unit(
                "certificate_expiry",
                "Time until the certificate of the daemon expires; negative if it has expired",
                Unit::Seconds,
                ConstGauge::new(validity.left_s(self.service.render.time().machine_now())),
            );
        }
        let mut encoded = String::new();
        match encode(&mut encoded, &all) {
            Ok(()) => text(StatusCode::OK, TYPE, encoded),
            Err(error) => text(StatusCode::INTERNAL_SERVER_ERROR, PLAIN, error.to_string()),
        }
    }

    /// Answers whether the daemon can draw frames. Any client may ask, so the answer reveals nothing else.
    fn health(&self) -> Response<Body> {
        let is_ending = self.service.render.scene().is_err();
        match self.service.render.figures().frames.failures.problem {
            _ if is_ending => text(StatusCode::SERVICE_UNAVAILABLE, PLAIN, "shutting down\n".to_owned()),
            Some(_) => text(StatusCode::SERVICE_UNAVAILABLE, PLAIN, "frames cannot be drawn\n".to_owned()),
            None => text(StatusCode::OK, PLAIN, "ok\n".to_owned()),
        }
    }
}

impl HttpHandler for Metrics {
    fn answer(&self, request: &Request<Body>) -> Option<Response<Body>> {
        let is_head = request.method() == Method::HEAD;
        if !is_head && request.method() != Method::GET {
            return None;
        }
        let response = match request.uri().path() {
            METRICS => self.metrics(),
            HEALTH => self.health(),
            _ => return None,
        };
        Some(if is_head { response.map(|_| Body::empty()) } else { response })
    }
}

/// Returns the current metrics.
fn registry(service: &Service) -> Registry {
    let mut all = Registry::with_prefix("steradian");
    let (figures, streams) = (service.render.figures(), service.render.streams());
    let counts: [(&str, &str, u64); 7] = [
        ("frames_rendered", "Frames of the render thread", figures.frames.frames_rendered),
        ("frames_failed", "Frames that could not be drawn", figures.frames.failures.count),
        ("renderer_losses", "Number of times that the renderer was lost and reopened", figures.frames.losses),
        ("frames_dropped", "Frames that slow readers missed", streams.dropped()),
        ("encodings", "Number of times that the images of a view in a frame were encoded", service.encoders.count()),
        ("encoded_bytes", "Bytes of encoded images", service.encoders.bytes()),
        ("requests_refused", "Requests that were refused because of a limit", service.shares.refused()),
    ];
    for (name, help, value) in counts {
        all.register(name, help, ConstCounter::new(value));
    }
    let encoding_s = ConstCounter::new(service.encoders.busy().as_secs_f64());
    all.register_with_unit("encoding", "Time that encoders were busy", Unit::Seconds, encoding_s);
    all.register("connections", "Connections now", ConstGauge::new(service.shares.connections()));
    all.register("streams", "Streams of frames now", ConstGauge::new(streams.count() as u64));
    let queue = ConstGauge::new(service.render.requests_waiting() as u64);
    all.register("requests_waiting", "Calls that are waiting for a frame", queue);
    if let Ok(scene) = service.render.scene() {
        all.register("scene_revision", "Revision of the scene", ConstGauge::new(scene.revision));
    }
    all.register("camera_revision", "Revision of the camera", ConstGauge::new(service.render.camera().revision));
    if let Some(quality) = &figures.quality {
        all.register(
            "quality_level",
            "Quality level of display images; 0: full quality",
            ConstGauge::new(quality.level),
        );
    }
    let seconds = |of: &mut Registry, name: &str, help: &str, ms: f64| {
        of.register_with_unit(name, help, Unit::Seconds, ConstGauge::new(ms * 1e-3));
    };
    if let Some(times) = &figures.frames.last_times {
        seconds(&mut all, "frame_plan", "Duration of the planning of the last frame", times.plan_ms);
        seconds(&mut all, "frame", "Duration of the whole last frame", times.total_ms);
        let passes = Family::<Vec<(&str, String)>, Gauge<f64, AtomicU64>>::default();
        for (pass, ms) in &times.passes_ms {
            // A pass may occur more than once in a frame.
            passes.get_or_create(&vec![("pass", pass.to_string())]).inc_by(ms * 1e-3);
        }
        all.register_with_unit("frame_pass", "Duration of the passes of the last frame", Unit::Seconds, passes);
    }
    if let Some(age) = figures.frames.last_age {
        let age_s = ConstGauge::new(age.as_secs_f64());
        all.register_with_unit(
            "pose_age",
            "Age of the pose of the last frame when it was finished",
            Unit::Seconds,
            age_s,
        );
    }
    if let Some(headset) = &service.headset {
        let (status, statistics) = headset.report();
        let connected = u32::from(matches!(status, xr::Status::Connected { .. }));
        all.register("headset_connected", "Whether the headset is connected", ConstGauge::new(connected));
        all.register("headset_frames", "Frames of the headset", ConstCounter::new(statistics.frames));
        all.register("headset_losses", "Losses of the headset", ConstCounter::new(statistics.losses));
    }
    if let Some(cluster) = &service.cluster {
        register_cluster(&mut all, &cluster.figures());
    }
    if let Some(bytes) = process::resident_bytes() {
        all.register_with_unit(
            "resident_memory",
            "Resident memory of the process",
            Unit::Bytes,
            ConstGauge::new(bytes),
        );
    }
    all
}

/// Registers the figures of a cluster: times in seconds, counts by kind, and for a director those of its nodes.
fn register_cluster(all: &mut Registry, figures: &ClusterFigures) {
    type Gauges = Family<Vec<(&'static str, String)>, Gauge<f64, AtomicU64>>;
    all.register(
        "cluster_locked",
        "Whether all nodes show the same frames",
        ConstGauge::new(u32::from(figures.locked)),
    );
    all.register("cluster_epoch", "Counter of the director's epoch", ConstGauge::new(figures.epoch));
    all.register("cluster_frame", "Newest frame that was committed or shown", ConstGauge::new(figures.frame_number));
    let counts = Gauges::default();
    for (kind, count) in &figures.counts {
        counts.get_or_create(&vec![("kind", (*kind).to_owned())]).set(*count as f64);
    }
    all.register("cluster_events", "Events of the lock since the start, by kind", counts);
    let quantiles = |times: Times| [("median", times.median_ms), ("p99", times.p99_ms), ("max", times.max_ms)];
    let times = Gauges::default();
    for (of, measured) in &figures.times {
        for (quantile, ms) in quantiles(*measured) {
            let labels = vec![("of", (*of).to_owned()), ("quantile", quantile.to_owned())];
            times.get_or_create(&labels).set(ms * 1e-3);
        }
    }
    all.register_with_unit("cluster_time", "Times of the last 1024 frames", Unit::Seconds, times);
    if figures.nodes.is_empty() {
        return;
    }
    let (is_in, out, refused, ready) = (Gauges::default(), Gauges::default(), Gauges::default(), Gauges::default());
    for node in &figures.nodes {
        let labels = vec![("node", node.name.clone())];
        is_in.get_or_create(&labels).set(if node.state == "in" { 1.0 } else { 0.0 });
        out.get_or_create(&labels).set(node.out as f64);
        refused.get_or_create(&labels).set(node.refused as f64);
        for (quantile, ms) in quantiles(node.ready) {
            let labels = vec![("node", node.name.clone()), ("quantile", quantile.to_owned())];
            ready.get_or_create(&labels).set(ms * 1e-3);
        }
    }
    all.register("cluster_node_in", "Whether a node takes part", is_in);
    all.register("cluster_node_out", "Number of times that a node was left out", out);
    all.register("cluster_node_refused", "Number of times that a node was refused", refused);
    all.register_with_unit("cluster_node_ready", "Time from STATE to READY of a node", Unit::Seconds, ready);
}
