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

/// A buffer filled with `data` at creation, of that usage.
pub(crate) fn filled_buffer<T: NoUninit>(
    gpu: &Gpu,
    label: &str,
    data: &[T],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    let buffer = gpu.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (bytes.len() as u64).max(16).next_multiple_of(16),
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: true,
    });
    if !bytes.is_empty() {
        // A buffer that could not be made is not mapped; the device's error handler has the reason then.
        if let Ok(mut range) = buffer.slice(..bytes.len() as u64).get_mapped_range_mut() {
            range.copy_from_slice(bytes);
        }
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
            // Not destroyed: what was recorded with it in this frame may not have been submitted.
            self.buffer = None;
        }
        self.buffer.get_or_insert_with(|| {
            gpu.create_buffer(&wgpu::BufferDescriptor {
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

    /// The buffer, if it has been made.
    pub(crate) fn held(&self) -> Option<&wgpu::Buffer> {
        self.buffer.as_ref()
    }

    /// Gives the buffer back once what was submitted is done with it, whoever still names it.
    pub(crate) fn release(&mut self) {
        if let Some(buffer) = self.buffer.take() {
            buffer.destroy();
        }
    }
}

/// Where results lie in the readback buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ReadbackPlace {
    buffer: usize,
    offset: u64,
}

/// Host-visible buffers into which results are copied: as many as it takes, none larger than the adapter allows.
pub(crate) struct ReadbackBuffer {
    label: &'static str,
    buffers: Vec<GrowingBuffer>,
    /// Bytes used of each buffer of the frame so far.
    used: Vec<u64>,
    /// Bytes that are still to be copied, as announced.
    expected: u64,
}

impl ReadbackBuffer {
    pub(crate) fn new(label: &'static str) -> Self {
        Self { label, buffers: Vec::new(), used: Vec::new(), expected: 0 }
    }

    /// Forgets what was there; about `bytes` are going to be copied.
    pub(crate) fn begin(&mut self, bytes: u64) {
        self.used.clear();
        self.expected = bytes;
    }

    /// Records a copy of `bytes`, at most what one buffer may have, from `source`; returns where they will be.
    pub(crate) fn copy(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        source: &wgpu::Buffer,
        offset: u64,
        bytes: u64,
    ) -> ReadbackPlace {
        let limit = gpu.max_readback_bytes();
        if self.used.last().is_none_or(|used| used + bytes > limit) {
            self.used.push(0);
        }
        let index = self.used.len() - 1;
        if self.buffers.len() <= index {
            let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
            self.buffers.push(GrowingBuffer::new(self.label, usage));
        }
        let place = ReadbackPlace { buffer: index, offset: self.used[index] };
        // A buffer is made once per frame, with room for all that is still to come: it must not grow after a copy into it.
        let room = if place.offset == 0 { self.expected.min(limit).max(bytes) } else { place.offset + bytes };
        encoder.copy_buffer_to_buffer(source, offset, self.buffers[index].with_room(gpu, room), place.offset, bytes);
        self.used[index] = (place.offset + bytes).next_multiple_of(16);
        self.expected = self.expected.saturating_sub(bytes);
        place
    }

    /// Asks for the buffers to be mapped; the next wait for the device completes it.
    pub(crate) fn map(&mut self, gpu: &Gpu) {
        for (buffer, used) in self.buffers.iter_mut().zip(&self.used) {
            // A failure to map surfaces as the error of `read`.
            buffer.with_room(gpu, *used).slice(..*used).map_async(wgpu::MapMode::Read, |_| {});
        }
    }

    /// The values at `place`, after the device was waited for.
    pub(crate) fn read<T: Pod>(&mut self, gpu: &Gpu, place: ReadbackPlace, count: usize) -> Result<Vec<T>, GpuError> {
        let mut values = Vec::with_capacity(count);
        self.append(gpu, place, count, &mut values)?;
        Ok(values)
    }

    /// Appends the values at `place`, after the device was waited for.
    pub(crate) fn append<T: Pod>(
        &mut self,
        gpu: &Gpu,
        place: ReadbackPlace,
        count: usize,
        values: &mut Vec<T>,
    ) -> Result<(), GpuError> {
        let bytes = (count * size_of::<T>()) as u64;
        let buffer = self.buffers[place.buffer].with_room(gpu, self.used[place.buffer]);
        let view = buffer.slice(place.offset..place.offset + bytes).get_mapped_range()?;
        values.extend_from_slice(bytemuck::cast_slice(&view));
        Ok(())
    }

    /// Ends reading.
    pub(crate) fn unmap(&mut self, gpu: &Gpu) {
        for (buffer, used) in self.buffers.iter_mut().zip(&self.used) {
            buffer.with_room(gpu, *used).unmap();
        }
        // What a smaller frame does not need is given back.
        self.buffers.truncate(self.used.len());
    }
}
