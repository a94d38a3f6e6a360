//! Draws one frame with a method of drawing asteroids and times its parts.

use std::time::{Duration, Instant};

use super::workload::Variant;
use crate::{
    chart::{
        ChartError, Spread, ViewShape,
        timing::{Taken, message_of},
        workloads::rig_of,
    },
    render::{AsteroidCounts, FrameRequest, FrameTimes, Renderer, Wanted},
    scene::{Camera, SceneSnapshot},
    view::Rig,
};

/// Times of the asteroid work of a frame, ms.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Parts {
    /// Planning on the CPU: culling of groups or of all asteroids, uploads, recording of passes.
    pub plan_ms: f64,
    /// Culling on the adapter.
    pub cull_ms: f64,
    /// Drawing meshes and impostors.
    pub layers_ms: f64,
    /// Compositing into the pictures, which includes bodies.
    pub geometry_ms: f64,
    /// Drawing points, which are asteroids, because there are no stars.
    pub points_ms: f64,
}

impl Parts {
    /// Sums the parts of a frame; `None` if the adapter has no timestamps.
    pub fn from_times(times: &FrameTimes) -> Option<Self> {
        times.gpu_ms?;
        let pass_ms =
            |name: &str| times.passes_ms.iter().filter(|pass| pass.0 == name).fold(0.0, |sum, pass| sum + pass.1);
        Some(Self {
            plan_ms: times.plan_ms,
            cull_ms: pass_ms("asteroid cull"),
            layers_ms: pass_ms("asteroids"),
            geometry_ms: pass_ms("geometry"),
            points_ms: pass_ms("stars"),
        })
    }

    /// Returns the total time.
    pub fn whole_ms(&self) -> f64 {
        self.plan_ms + self.cull_ms + self.layers_ms + self.geometry_ms + self.points_ms
    }

    /// Returns the time of planning and culling.
    pub fn culling_ms(&self) -> f64 {
        self.plan_ms + self.cull_ms
    }

    /// Returns the median of each part separately.
    pub fn medians(all: &[Self]) -> Option<Self> {
        let median = |part: fn(&Self) -> f64| {
            Spread::from_values(&all.iter().map(part).collect::<Vec<_>>()).map(|spread| spread.median_ms)
        };
        Some(Self {
            plan_ms: median(|parts| parts.plan_ms)?,
            cull_ms: median(|parts| parts.cull_ms)?,
            layers_ms: median(|parts| parts.layers_ms)?,
            geometry_ms: median(|parts| parts.geometry_ms)?,
            points_ms: median(|parts| parts.points_ms)?,
        })
    }
}

/// Times and counts of all frames of a method in a workload.
#[derive(Clone, Debug, Default)]
pub struct FrameParts {
    /// Parts of every frame; buffers grow during the first one.
    pub parts: Vec<Parts>,
    /// Counts of the last frame, summed over all views.
    pub counts: Option<AsteroidCounts>,
}

impl FrameParts {
    /// Returns the frames that count: all but the first, unless it is the only one.
    pub fn counted(&self) -> &[Parts] {
        self.parts.get(1..).filter(|rest| !rest.is_empty()).unwrap_or(&self.parts)
    }

    /// Describes the medians and counts in one line.
    pub fn note(&self) -> String {
        let mut notes = Vec::new();
        if let Some(parts) = Parts::medians(self.counted()) {
            let Parts { plan_ms, cull_ms, layers_ms, geometry_ms, points_ms } = parts;
            notes.push(format!(
                "plan on the CPU {plan_ms:.2}, cull {cull_ms:.2}, meshes and impostors {layers_ms:.2}, geometry {geometry_ms:.2}, points {points_ms:.2} ms"
            ));
        }
        if let Some(AsteroidCounts { meshes, impostors, hidden, points, culled, .. }) = &self.counts {
            let meshes = meshes.iter().map(u64::to_string).collect::<Vec<_>>().join(" ");
            notes.push(format!(
                "drawn: meshes {meshes}, impostors {impostors} ({hidden} hidden), points {points}, culled {culled}"
            ));
        }
        notes.join("; ")
    }
}

/// Draws a tiny picture that sees nothing, which loads shapes and atlases, then draws the frame that is timed.
pub fn turn(
    renderer: &mut Renderer,
    variant: &Variant,
    scene: &SceneSnapshot,
    rig: &Rig,
    record: &mut FrameParts,
) -> Result<Taken, ChartError> {
    let settings = variant.render_settings();
    let away = SceneSnapshot {
        camera: Camera { position_m: scene.camera.position_m + glam::DVec3::Y * 1e9, ..scene.camera },
        ..scene.clone()
    };
    let tiny = rig_of(vec![("tiny", ViewShape::Flat([16, 16]).kind())])?;
    if let Err(error) = renderer.render(
        FrameRequest::new(&away, &tiny).settings(&settings).wanted(Wanted { hdr_stays: true, ..Wanted::default() }),
    ) {
        return message_of(error).map(Err);
    }
    let start = Instant::now();
    match renderer.render(
        FrameRequest::new(scene, rig).settings(&settings).wanted(Wanted { hdr_stays: true, ..Wanted::default() }),
    ) {
        Ok(frame) => {
            let parts = Parts::from_times(&frame.times);
            record.parts.extend(parts);
            record.counts = Some(sum(frame.views.iter().map(|view| &view.asteroids)));
            let took: Duration = start.elapsed();
            Ok(Ok((parts.map(|parts| parts.whole_ms()), took)))
        }
        Err(error) => message_of(error).map(Err),
    }
}

fn sum<'a>(all: impl Iterator<Item = &'a AsteroidCounts>) -> AsteroidCounts {
    all.fold(AsteroidCounts::default(), |mut sum, counts| {
        sum.meshes.resize(sum.meshes.len().max(counts.meshes.len()), 0);
        sum.meshes.iter_mut().zip(&counts.meshes).for_each(|(sum, count)| *sum += count);
        sum.impostors += counts.impostors;
        sum.hidden += counts.hidden;
        sum.points += counts.points;
        sum.unresolved += counts.unresolved;
        sum.culled += counts.culled;
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(plan_ms: f64, gpu_ms: Option<f64>) -> FrameTimes {
        let passes_ms = vec![
            ("begin", 9.0),
            ("asteroid cull", 1.0),
            ("asteroids", 2.0),
            ("asteroids", 3.0),
            ("geometry", 4.0),
            ("stars", 5.0),
            ("resolve", 70.0),
        ];
        FrameTimes { passes_ms, plan_ms, gpu_ms, ..FrameTimes::default() }
    }

    #[test]
    fn time_covers_asteroid_passes_and_planning_only() {
        let parts = Parts::from_times(&times(0.5, Some(100.0))).unwrap();
        assert_eq!((parts.whole_ms(), parts.culling_ms(), parts.layers_ms), (15.5, 1.5, 5.0));
        assert_eq!(Parts::from_times(&times(0.5, None)), None);
        let record = FrameParts { parts: vec![Parts { plan_ms: 99.0, ..parts }, parts, parts], counts: None };
        assert!(record.note().starts_with("plan on the CPU 0.50, cull 1.00"), "{}", record.note());
        assert!(FrameParts::default().note().is_empty());
    }
}
