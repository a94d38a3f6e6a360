//! Buffers of parameters and bind groups that frames reuse: a frame that needs the same objects as the previous frame creates none.
//!
//! A frame requests its buffers in the same order as the previous frame and receives the same ones with new contents. Writes to a queue are
//! executed after all earlier submissions, so they do not disturb a frame that is still being drawn. A bind group is identified by its
//! layout and its resources. Objects that [`KEPT_FRAMES`] frames did not request are dropped.

use std::{
    collections::HashMap,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
};

use bytemuck::NoUninit;
use serde::Serialize;

use super::Gpu;

/// Number of frames without a request after which an object is dropped.
const KEPT_FRAMES: u64 = 8;

/// Numbers of created objects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ObjectsMade<N = u64> {
    /// Buffers.
    pub buffers: N,
    /// Bind groups.
    pub bind_groups: N,
    /// Pipelines.
    pub pipelines: N,
}

/// Counts the objects that a device creates.
pub(super) type Counters = ObjectsMade<AtomicU64>;

impl ObjectsMade {
    /// Returns their sum.
    pub fn all(&self) -> u64 {
        self.buffers + self.bind_groups + self.pipelines
    }

    /// Returns the numbers of objects created since `before`.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        Self {
            buffers: self.buffers - before.buffers,
            bind_groups: self.bind_groups - before.bind_groups,
            pipelines: self.pipelines - before.pipelines,
        }
    }
}

/// Source of the layout of a bind group.
#[derive(Clone, Copy)]
pub(crate) enum LayoutOf<'a> {
    /// The shader of a compute pipeline, and the index of the group.
    Compute(&'a wgpu::ComputePipeline, u32),
    /// The shaders of a render pipeline, and the index of the group.
    Render(&'a wgpu::RenderPipeline, u32),
    /// An explicit layout.
    Own(&'a wgpu::BindGroupLayout),
}

#[derive(PartialEq, Eq, Hash)]
enum LayoutKey {
    Compute(wgpu::ComputePipeline, u32),
    Render(wgpu::RenderPipeline, u32),
    Own(wgpu::BindGroupLayout),
}

#[derive(PartialEq, Eq, Hash)]
enum ResourceKey {
    Buffer(wgpu::Buffer, u64, Option<wgpu::BufferSize>),
    View(wgpu::TextureView),
    Sampler(wgpu::Sampler),
}

impl ResourceKey {
    /// `None` for kinds of resources that no technique binds.
    fn new(resource: &wgpu::BindingResource<'_>) -> Option<Self> {
        Some(match resource {
            wgpu::BindingResource::Buffer(binding) => {
                Self::Buffer(binding.buffer.clone(), binding.offset, binding.size)
            }
            wgpu::BindingResource::TextureView(view) => Self::View((*view).clone()),
            wgpu::BindingResource::Sampler(sampler) => Self::Sampler((*sampler).clone()),
            _ => return None,
        })
    }
}

type GroupKey = (LayoutKey, Vec<(u32, ResourceKey)>);

/// Buffers with the same label and usage.
#[derive(Default)]
struct Slots {
    buffers: Vec<wgpu::Buffer>,
    /// Number of buffers that the current frame has requested.
    used: usize,
    /// Largest number of buffers that a frame has requested since frame `since`.
    most: usize,
    since: u64,
}

/// The reused objects of a device.
#[derive(Default)]
pub(super) struct FramePool {
    frame: u64,
    slots: HashMap<(&'static str, wgpu::BufferUsages), Slots>,
    /// Each object with the last frame that requested it.
    groups: HashMap<GroupKey, (wgpu::BindGroup, u64)>,
}

impl FramePool {
    fn begin_frame(&mut self) {
        self.frame += 1;
        let frame = self.frame;
        for slots in self.slots.values_mut() {
            slots.most = slots.most.max(slots.used);
            slots.used = 0;
            if frame - slots.since >= KEPT_FRAMES {
                slots.buffers.truncate(slots.most);
                (slots.most, slots.since) = (0, frame);
            }
        }
        self.slots.retain(|_, slots| !slots.buffers.is_empty());
        self.groups.retain(|_, (_, last)| frame - *last <= KEPT_FRAMES);
    }
}

/// Locks a pool. After a panic it can still be used, because every call leaves it consistent.
fn lock(pool: &Mutex<FramePool>) -> MutexGuard<'_, FramePool> {
    pool.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Gpu {
    /// Begins a frame, which reuses the buffers of the previous one.
    pub(crate) fn begin_frame(&self) {
        lock(&self.pool).begin_frame();
    }

    /// Drops all reused objects.
    pub(crate) fn forget_frames(&self) {
        *lock(&self.pool) = FramePool::default();
    }

    /// Returns the numbers of objects created so far.
    pub fn made(&self) -> ObjectsMade {
        let Counters { buffers, bind_groups, pipelines } = &*self.counters;
        ObjectsMade {
            buffers: buffers.load(Relaxed),
            bind_groups: bind_groups.load(Relaxed),
            pipelines: pipelines.load(Relaxed),
        }
    }

    /// Creates and counts a buffer.
    pub(crate) fn create_buffer(&self, descriptor: &wgpu::BufferDescriptor<'_>) -> wgpu::Buffer {
        self.counters.buffers.fetch_add(1, Relaxed);
        self.device.create_buffer(descriptor)
    }

    /// Returns a uniform buffer for this frame only.
    pub(crate) fn frame_uniform<T: NoUninit>(&self, label: &'static str, data: &T) -> wgpu::Buffer {
        self.frame_buffer(label, std::slice::from_ref(data), 1, wgpu::BufferUsages::UNIFORM)
    }

    /// Returns a uniform buffer for this frame only, for a list that shaders declare with `capacity` items.
    pub(crate) fn frame_uniform_list<T: NoUninit>(
        &self,
        label: &'static str,
        items: &[T],
        capacity: usize,
    ) -> wgpu::Buffer {
        assert!(items.len() <= capacity, "{label}: {} items, {capacity} fit", items.len());
        self.frame_buffer(label, items, capacity, wgpu::BufferUsages::UNIFORM)
    }

    /// Returns a storage buffer for this frame only; it may be larger than `data`.
    pub(crate) fn frame_storage<T: NoUninit>(&self, label: &'static str, data: &[T]) -> wgpu::Buffer {
        // A binding must have the size of at least one item, even for an empty list.
        self.frame_buffer(label, data, 1, wgpu::BufferUsages::STORAGE)
    }

    /// Returns a buffer that begins with `data` and has room for at least `least` items.
    fn frame_buffer<T: NoUninit>(
        &self,
        label: &'static str,
        data: &[T],
        least: usize,
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let size = (bytes.len().max(least * size_of::<T>()).max(16) as u64).next_multiple_of(16);
        let mut pool = lock(&self.pool);
        let frame = pool.frame;
        let slots = pool.slots.entry((label, usage)).or_insert_with(|| Slots { since: frame, ..Slots::default() });
        let index = slots.used;
        slots.used += 1;
        let make = || {
            self.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        match slots.buffers.get(index) {
            Some(held) if held.size() >= size => {}
            Some(_) => slots.buffers[index] = make(),
            None => slots.buffers.push(make()),
        }
        let buffer = slots.buffers[index].clone();
        drop(pool);
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    /// Returns a bind group of a layout, with the given resources in the order of the bindings. Reuses an existing bind group with the same
    /// resources, if any.
    pub(crate) fn bind(&self, layout: LayoutOf<'_>, resources: &[(u32, wgpu::BindingResource<'_>)]) -> wgpu::BindGroup {
        let bound: Option<Vec<_>> =
            resources.iter().map(|(binding, resource)| Some((*binding, ResourceKey::new(resource)?))).collect();
        let key = bound.map(|bound| {
            let layout = match layout {
                LayoutOf::Compute(pipeline, group) => LayoutKey::Compute(pipeline.clone(), group),
                LayoutOf::Render(pipeline, group) => LayoutKey::Render(pipeline.clone(), group),
                LayoutOf::Own(layout) => LayoutKey::Own(layout.clone()),
            };
            (layout, bound)
        });
        let mut pool = lock(&self.pool);
        let frame = pool.frame;
        if let Some((group, last)) = key.as_ref().and_then(|key| pool.groups.get_mut(key)) {
            *last = frame;
            return group.clone();
        }
        let group = self.bind_once(layout, resources);
        if let Some(key) = key {
            pool.groups.insert(key, (group.clone(), frame));
        }
        group
    }

    /// Creates a bind group that is not kept for reuse.
    pub(crate) fn bind_once(
        &self,
        layout: LayoutOf<'_>,
        resources: &[(u32, wgpu::BindingResource<'_>)],
    ) -> wgpu::BindGroup {
        let implied;
        let layout = match layout {
            LayoutOf::Compute(pipeline, group) => {
                implied = pipeline.get_bind_group_layout(group);
                &implied
            }
            LayoutOf::Render(pipeline, group) => {
                implied = pipeline.get_bind_group_layout(group);
                &implied
            }
            LayoutOf::Own(layout) => layout,
        };
        let entries: Vec<wgpu::BindGroupEntry<'_>> = resources
            .iter()
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
            .collect();
        self.counters.bind_groups.fetch_add(1, Relaxed);
        let descriptor = wgpu::BindGroupDescriptor { label: Some("pass"), layout, entries: &entries };
        self.device.create_bind_group(&descriptor)
    }
}
