//! GPU time of the passes of a frame, by timestamp queries.

use super::{Gpu, ReadbackBuffer, ReadbackPlace};

/// Largest number of timed passes of a frame.
const MAX_PASSES: u32 = 256;

/// Times the passes of a frame. If the adapter lacks timestamps, all methods do nothing and return no times.
pub(crate) struct GpuTimer {
    queries: Option<(wgpu::QuerySet, wgpu::Buffer)>,
    names: Vec<&'static str>,
    /// Whether the frame has more passes than can be timed. It then returns no times instead of wrong ones.
    too_many: bool,
    period_ns: f64,
}

impl GpuTimer {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let queries = gpu.timestamps.then(|| {
            let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * MAX_PASSES,
            });
            let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("pass times"),
                size: u64::from(2 * MAX_PASSES) * 8,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            (set, buffer)
        });
        Self { queries, names: Vec::new(), too_many: false, period_ns: f64::from(gpu.queue.get_timestamp_period()) }
    }

    pub(crate) fn begin(&mut self) {
        self.names.clear();
        self.too_many = false;
    }

    /// Returns the timestamp writes of a compute pass.
    pub(crate) fn pass(&mut self, name: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let (query_set, first) = self.next(name)?;
        Some(wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Returns the timestamp writes of a render pass.
    pub(crate) fn render_pass(&mut self, name: &'static str) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        let (query_set, first) = self.next(name)?;
        Some(wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Reserves the two queries of a pass and returns the first one.
    fn next(&mut self, name: &'static str) -> Option<(&wgpu::QuerySet, u32)> {
        let (set, _) = self.queries.as_ref()?;
        let index = self.names.len() as u32;
        if index >= MAX_PASSES {
            self.too_many = true;
            return None;
        }
        self.names.push(name);
        Some((set, 2 * index))
    }

    /// Returns the size of the times in the readback buffer, bytes.
    pub(crate) fn readback_bytes() -> u64 {
        u64::from(2 * MAX_PASSES) * 8
    }

    /// Records the copy of the times and returns its position.
    pub(crate) fn resolve(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        readback: &mut ReadbackBuffer,
    ) -> Option<ReadbackPlace> {
        let (set, buffer) = self.queries.as_ref()?;
        let count = 2 * self.names.len() as u32;
        if count == 0 || self.too_many {
            return None;
        }
        encoder.resolve_query_set(set, 0..count, buffer, 0);
        Some(readback.copy(gpu, encoder, buffer, 0, u64::from(count) * 8))
    }

    /// Returns the name and duration in ms of every pass.
    pub(crate) fn times_ms(&self, ticks: &[u64]) -> Vec<(&'static str, f64)> {
        self.names
            .iter()
            .zip(ticks.as_chunks::<2>().0)
            .map(|(name, [begin, end])| (*name, end.saturating_sub(*begin) as f64 * self.period_ns * 1e-6))
            .collect()
    }

    /// Returns the duration from the beginning of the first pass to the end of the last pass, ms.
    pub(crate) fn whole_ms(&self, ticks: &[u64]) -> Option<f64> {
        let (begin, end) = (ticks.first()?, ticks.last()?);
        Some(end.saturating_sub(*begin) as f64 * self.period_ns * 1e-6)
    }

    pub(crate) fn passes(&self) -> usize {
        self.names.len()
    }
}
