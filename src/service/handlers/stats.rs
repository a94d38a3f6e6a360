//! Messages with the statistics of the daemon and of its headset.

use crate::{
    plan::{
        audit::{Audit, AuditedOutput, ImageAudit},
        settings::RenderSettings,
        view_settings::ViewSettings,
    },
    render::FrameTimes,
    service::{
        cluster::{
            Cluster,
            figures::{ClusterFigures, NodeFigures, Times},
        },
        displays::{headset::Headset, windows::Windows},
        engine::{
            auditor::AuditFigures,
            render_handle::{QualityFigures, RenderHandle},
        },
        frames::image_encoding::Encoders,
        network::clients::Shares,
        proto,
        scene::state::SceneState,
        wire::views::settings_to_pb,
    },
    view::Part,
    windows::{Intervals, WindowFigures},
    xr::{Distribution, HeadsetStatistics, Status},
};

/// Type name of a headset's view.
const TYPE: &str = "headset";

fn images_to_pb(sizes: &[[u32; 2]; 2]) -> Vec<proto::ViewImage> {
    let image = |(part, [width, height]): (Part, [u32; 2])| proto::ViewImage {
        part: part.name().unwrap_or_default().to_owned(),
        width,
        height,
        ..Default::default()
    };
    [Part::LeftEye, Part::RightEye].into_iter().zip(*sizes).map(image).collect()
}

fn known_to_pb(view: &str, status: &Status) -> proto::HeadsetStatus {
    let view = view.to_owned();
    match status {
        Status::Disconnected { reason, retrying } => {
            proto::HeadsetStatus { view, reason: reason.clone(), retrying: *retrying, ..Default::default() }
        }
        Status::Connected { runtime, system, state, sizes, adapter, problem } => proto::HeadsetStatus {
            view,
            connected: true,
            reason: problem.clone().unwrap_or_default(),
            runtime: runtime.clone(),
            system: system.clone(),
            adapter: adapter.clone(),
            session_state: (*state).to_owned(),
            images: images_to_pb(sizes),
            ..Default::default()
        },
    }
}

pub(crate) fn status_to_pb(headset: &Headset) -> proto::HeadsetStatus {
    known_to_pb(headset.name(), &headset.report().0)
}

/// Returns the message of the headset's view, with the general settings.
pub(crate) fn headset_view_to_pb(headset: &Headset, general: &RenderSettings, scene: &SceneState) -> proto::View {
    proto::View {
        name: headset.name().to_owned(),
        r#type: TYPE.to_owned(),
        images: status_to_pb(headset).images,
        revision: scene.revision,
        ..settings_to_pb(&ViewSettings::general(general), scene.stars.method)
    }
}

fn distribution_to_pb(time: &Distribution) -> proto::Distribution {
    proto::Distribution { median_ms: time.median_ms, p95_ms: time.p95_ms, max_ms: time.max_ms }
}

fn headset_to_pb(headset: &Headset) -> proto::HeadsetStats {
    let (status, statistics) = headset.report();
    let HeadsetStatistics {
        sessions,
        losses,
        frames,
        rendered,
        not_wanted,
        left_out,
        missed,
        recentred,
        period_ms,
        pose_age_at_submission,
        pose_age_at_display,
        stages,
    } = statistics;
    let stage = |(name, time): &(&str, Distribution)| proto::StageTime {
        name: (*name).to_owned(),
        time: Some(distribution_to_pb(time)),
    };
    proto::HeadsetStats {
        status: Some(known_to_pb(headset.name(), &status)),
        sessions,
        losses,
        frames,
        rendered,
        not_wanted,
        left_out,
        missed,
        recentred,
        period_ms,
        pose_age_at_submission: Some(distribution_to_pb(&pose_age_at_submission)),
        pose_age_at_display: pose_age_at_display.as_ref().map(distribution_to_pb),
        stages: stages.iter().map(stage).collect(),
    }
}

fn times_to_pb(times: FrameTimes) -> proto::FrameTimes {
    let FrameTimes { plan_ms, passes_ms, gpu_ms, cull_ms, objects_made, gpu_and_readback_ms, total_ms } = times;
    let pass = |(name, ms): (&str, f64)| proto::PassTime { name: name.to_owned(), ms };
    proto::FrameTimes {
        objects_made,
        plan_ms,
        cull_ms,
        gpu_and_readback_ms,
        total_ms,
        gpu_ms,
        passes: passes_ms.into_iter().map(pass).collect(),
    }
}

fn quality_to_pb(quality: QualityFigures) -> proto::QualityStats {
    let QualityFigures { frame_ms, smoothed_ms, level, given_up } = quality;
    proto::QualityStats { frame_ms, smoothed_ms, level, given_up }
}

fn image_audit_to_pb(image: ImageAudit) -> proto::ImageAudit {
    let hdr = image.output == AuditedOutput::Hdr;
    let ImageAudit { view, part, pixels, error_999, largest, budget, most, unit, within_budget, worst, .. } = image;
    let [worst_x, worst_y] = worst.map_or([0, 0], |worst| [worst.x, worst.y]);
    proto::ImageAudit {
        view,
        part: part.unwrap_or_default(),
        hdr,
        pixels: u32::try_from(pixels).unwrap_or(u32::MAX),
        error_999,
        largest,
        budget,
        most,
        unit: unit.to_owned(),
        within_budget,
        worst_x,
        worst_y,
    }
}

fn audits_to_pb(AuditFigures { audited, broken, last }: AuditFigures) -> proto::AuditStats {
    let (last_frame_number, Audit { images, not_audited }) = last.unwrap_or_default();
    proto::AuditStats {
        frames_audited: audited,
        frames_broken: broken,
        last_frame_number,
        images: images.into_iter().map(image_audit_to_pb).collect(),
        not_audited,
    }
}

fn window_to_pb(figures: WindowFigures) -> proto::WindowStats {
    let WindowFigures { name, view, part, state, monitor, refresh_hz, frame_number, frames, intervals, missed } =
        figures;
    let intervals = intervals.map(|Intervals { median_ms, p99_ms, longest_ms }| proto::WindowIntervals {
        median_ms,
        p99_ms,
        longest_ms,
    });
    let (state, reason) = (state.name().to_owned(), state.reason().to_owned());
    proto::WindowStats { name, view, part, state, reason, monitor, refresh_hz, frame_number, frames, intervals, missed }
}

fn cluster_times_to_pb(Times { median_ms, p99_ms, max_ms }: Times) -> proto::ClusterTimes {
    proto::ClusterTimes { median_ms, p99_ms, max_ms }
}

fn cluster_node_to_pb(node: NodeFigures) -> proto::ClusterNodeStats {
    proto::ClusterNodeStats {
        name: node.name,
        state: node.state.to_owned(),
        reason: node.reason,
        ready: Some(cluster_times_to_pb(node.ready)),
        drawn: Some(cluster_times_to_pb(node.drawn)),
        out: node.out,
        refused: node.refused,
        version: node.version,
        adapter: node.adapter,
        scene_hash: node.scene_hash,
        frame_number: node.frame_number,
        clock: node.clock,
    }
}

fn cluster_to_pb(figures: ClusterFigures) -> proto::ClusterStats {
    let times = figures.times.into_iter().map(|(name, times)| (name.to_owned(), cluster_times_to_pb(times)));
    proto::ClusterStats {
        cluster: figures.cluster,
        process: figures.process,
        state: figures.state,
        reason: figures.reason,
        locked: figures.locked,
        epoch: figures.epoch,
        frame_number: figures.frame_number,
        version: figures.version,
        configuration: figures.configuration,
        scene_hash: figures.scene_hash,
        scene_revision: figures.scene_revision,
        clock: figures.clock,
        real_time: figures.real_time,
        counts: figures.counts.into_iter().map(|(name, count)| (name.to_owned(), count)).collect(),
        times: times.collect(),
        nodes: figures.nodes.into_iter().map(cluster_node_to_pb).collect(),
    }
}

/// Returns the current statistics.
pub(crate) fn stats_to_pb(
    render: &RenderHandle,
    (headset, windows, cluster): (Option<&Headset>, Option<&Windows>, Option<&Cluster>),
    encoders: &Encoders,
    shares: &Shares,
) -> proto::Stats {
    let (figures, streams) = (render.figures(), render.streams());
    proto::Stats {
        time: Some(render.time().machine_now().into()),
        frames_rendered: figures.frames.frames_rendered,
        streams: u32::try_from(streams.count()).unwrap_or(u32::MAX),
        frames_dropped: streams.dropped(),
        last_frame: figures.frames.last_times.map(times_to_pb),
        headset: headset.map(headset_to_pb),
        quality: figures.quality.map(quality_to_pb),
        audit: figures.audits.map(audits_to_pb),
        frames_failed: figures.frames.failures.count,
        problem: figures.frames.failures.problem.unwrap_or_default(),
        encoded: encoders.count(),
        connections: u32::try_from(shares.connections()).unwrap_or(u32::MAX),
        refused: shares.refused(),
        cluster: cluster.map(|cluster| cluster_to_pb(cluster.figures())),
        windows: windows.map(Windows::report).unwrap_or_default().into_iter().map(window_to_pb).collect(),
    }
}
