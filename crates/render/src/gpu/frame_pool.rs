//! Objects that frames use again, so that a frame like the last one makes none: buffers of parameters, and bind groups.
//!
//! A frame asks for its buffers in the same order as the frame before, and gets the same ones, filled anew: writes to a queue come
//! after everything that was submitted before, so a frame that is still being drawn is not disturbed. A bind group is known by its
//! layout and by what it binds. What [`KEPT_FRAMES`] frames did not ask for is given back.

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

/// Frames after which an object that was not asked for is given back.
const KEPT_FRAMES: u64 = 8;

/// Objects made so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ObjectsMade {
    /// Buffers.
    pub buffers: u64,
    /// Bind groups.
    pub bind_groups: u64,
    /// Pipelines.
    pub pipelines: u64,
}

impl ObjectsMade {
    /// All of them.
    pub fn all(&self) -> u64 {
        self.buffers + self.bind_groups + self.pipelines
    }

    /// Those made since `before`.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        Self {
            buffers: self.buffers - before.buffers,
            bind_groups: self.bind_groups - before.bind_groups,
            pipelines: self.pipelines - before.pipelines,
        }
    }
}

/// Counts what a device makes.
#[derive(Debug, Default)]
pub(super) struct Counters {
    pub(super) buffers: AtomicU64,
    pub(super) bind_groups: AtomicU64,
    pub(super) pipelines: AtomicU64,
}

/// Where a bind group's layout comes from.
#[derive(Clone, Copy)]
pub(crate) enum LayoutOf<'a> {
    /// That which the shader of a compute pipeline implies, and its number.
    Compute(&'a wgpu::ComputePipeline, u32),
    /// That which the shaders of a render pipeline imply, and its number.
    Render(&'a wgpu::RenderPipeline, u32),
    /// A layout of its own.
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
    fn of(resource: &wgpu::BindingResource<'_>) -> Option<Self> {
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

/// Buffers of one label and usage.
#[derive(Default)]
struct Slots {
    buffers: Vec<wgpu::Buffer>,
    /// How many the frame at hand has asked for.
    used: usize,
    /// The most that a frame has asked for since `since`.
    most: usize,
    since: u64,
}

/// See the module.
#[derive(Default)]
pub(super) struct FramePool {
    frame: u64,
    slots: HashMap<(&'static str, wgpu::BufferUsages), Slots>,
    /// With the last frame that asked for each.
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

/// The lock of a pool; one that a panic has left behind is as good as any, since every call leaves it whole.
fn lock(pool: &Mutex<FramePool>) -> MutexGuard<'_, FramePool> {
    pool.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Gpu {
    /// Begins a frame: buffers of the last one are used again.
    pub(crate) fn begin_frame(&self) {
        lock(&self.pool).begin_frame();
    }

    /// Lets go of what frames have used.
    pub(crate) fn forget_frames(&self) {
        *lock(&self.pool) = FramePool::default();
    }

    /// Objects made so far.
    pub fn made(&self) -> ObjectsMade {
        let Counters { buffers, bind_groups, pipelines } = &self.counters;
        ObjectsMade {
            buffers: buffers.load(Relaxed),
            bind_groups: bind_groups.load(Relaxed),
            pipelines: pipelines.load(Relaxed),
        }
    }

    /// A buffer, counted.
    pub(crate) fn create_buffer(&self, descriptor: &wgpu::BufferDescriptor<'_>) -> wgpu::Buffer {
        self.counters.buffers.fetch_add(1, Relaxed);
        self.device.create_buffer(descriptor)
    }

    /// A uniform of this frame alone.
    pub(crate) fn frame_uniform<T: NoUninit>(&self, label: &'static str, data: &T) -> wgpu::Buffer {
        self.frame_buffer(label, std::slice::from_ref(data), wgpu::BufferUsages::UNIFORM)
    }

    /// A storage buffer of this frame alone; it may be larger than `data`.
    pub(crate) fn frame_storage<T: NoUninit>(&self, label: &'static str, data: &[T]) -> wgpu::Buffer {
        self.frame_buffer(label, data, wgpu::BufferUsages::STORAGE)
    }

    fn frame_buffer<T: NoUninit>(&self, label: &'static str, data: &[T], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        // A binding must hold one item at least, even of an empty list.
        let size = (bytes.len().max(size_of::<T>()).max(16) as u64).next_multiple_of(16);
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

    /// A bind group of a layout, in the order of its bindings; the one that was made before where it binds the same.
    pub(crate) fn bind(&self, layout: LayoutOf<'_>, resources: &[(u32, wgpu::BindingResource<'_>)]) -> wgpu::BindGroup {
        let bound: Option<Vec<_>> =
            resources.iter().map(|(binding, resource)| Some((*binding, ResourceKey::of(resource)?))).collect();
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

    /// The same for what is bound once and not frame by frame: it is not kept.
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
