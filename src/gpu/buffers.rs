//! Buffers: growing ones that keep their place while they are large enough, and the way back to the host.

use bytemuck::{NoUninit, Pod};

use super::{Gpu, GpuError};

/// A storage buffer filled with `data` at creation, without a staging copy.
pub(crate) fn storage_buffer<T: NoUninit>(gpu: &Gpu, label: &str, data: &[T]) -> wgpu::Buffer {
    filled_buffer(gpu, label, data, wgpu::BufferUsages::STORAGE)
}

/// A uniform buffer filled with `data` at creation.
pub(crate) fn uniform_buffer<T: NoUninit>(gpu: &Gpu, label: &str, data: &T) -> wgpu::Buffer {
    filled_buffer(gpu, label, std::slice::from_ref(data), wgpu::BufferUsages::UNIFORM)
}

fn filled_buffer<T: NoUninit>(gpu: &Gpu, label: &str, data: &[T], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (bytes.len() as u64).max(16).next_multiple_of(16),
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: true,
    });
    if !bytes.is_empty() {
        let range = buffer.slice(..bytes.len() as u64).get_mapped_range_mut();
        range.expect("a buffer is mapped at its creation").copy_from_slice(bytes);
    }
    buffer.unmap();
    buffer
}

/// A buffer that is made anew only when it has to grow.
pub(crate) struct GrowingBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

impl GrowingBuffer {
    pub(crate) fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, usage, buffer: None }
    }

    /// The buffer, with room for at least `bytes`.
    pub(crate) fn with_room(&mut self, gpu: &Gpu, bytes: u64) -> &wgpu::Buffer {
        let bytes = bytes.max(16).next_multiple_of(16);
        if self.buffer.as_ref().is_some_and(|buffer| buffer.size() < bytes) {
            // Gone before its successor is made, so that both never exist at once.
            self.buffer = None;
        }
        self.buffer.get_or_insert_with(|| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(self.label),
                size: bytes,
                usage: self.usage,
                mapped_at_creation: false,
            })
        })
    }

    /// The buffer, filled with `data`.
    pub(crate) fn upload<T: NoUninit>(&mut self, gpu: &Gpu, data: &[T]) -> &wgpu::Buffer {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = self.with_room(gpu, bytes.len() as u64);
        gpu.queue.write_buffer(buffer, 0, bytes);
        buffer
    }

    pub(crate) fn release(&mut self) {
        self.buffer = None;
    }
}

/// A host-visible buffer into which results are copied.
pub(crate) struct ReadbackBuffer {
    inner: GrowingBuffer,
    used: u64,
}

impl ReadbackBuffer {
    pub(crate) fn new(label: &'static str) -> Self {
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        Self { inner: GrowingBuffer::new(label, usage), used: 0 }
    }

    /// Makes room for `bytes` and forgets what was there.
    pub(crate) fn begin(&mut self, gpu: &Gpu, bytes: u64) {
        self.inner.with_room(gpu, bytes);
        self.used = 0;
    }

    /// Records a copy of `bytes` from `source`; returns the place at which they will be.
    pub(crate) fn copy(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        source: &wgpu::Buffer,
        offset: u64,
        bytes: u64,
    ) -> u64 {
        let place = self.used;
        encoder.copy_buffer_to_buffer(source, offset, self.inner.with_room(gpu, place + bytes), place, bytes);
        self.used = (place + bytes).next_multiple_of(16);
        place
    }

    /// Asks for the buffer to be mapped; the next wait for the device completes it.
    pub(crate) fn map(&mut self, gpu: &Gpu) {
        let used = self.used;
        if used > 0 {
            // A failure to map surfaces as the error of `read`.
            self.inner.with_room(gpu, used).slice(..used).map_async(wgpu::MapMode::Read, |_| {});
        }
    }

    /// The values at `place`, after the device was waited for.
    pub(crate) fn read<T: Pod>(&mut self, gpu: &Gpu, place: u64, count: usize) -> Result<Vec<T>, GpuError> {
        let mut values = Vec::with_capacity(count);
        self.append(gpu, place, count, &mut values)?;
        Ok(values)
    }

    /// Appends the values at `place`, after the device was waited for.
    pub(crate) fn append<T: Pod>(
        &mut self,
        gpu: &Gpu,
        place: u64,
        count: usize,
        values: &mut Vec<T>,
    ) -> Result<(), GpuError> {
        let bytes = (count * size_of::<T>()) as u64;
        let view = self.inner.with_room(gpu, self.used).slice(place..place + bytes).get_mapped_range()?;
        values.extend_from_slice(bytemuck::cast_slice(&view));
        Ok(())
    }

    /// Ends reading.
    pub(crate) fn unmap(&mut self, gpu: &Gpu) {
        let used = self.used;
        if used > 0 {
            self.inner.with_room(gpu, used).unmap();
        }
    }
}
