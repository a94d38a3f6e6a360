//! Renderers lent from a pool. To open a device and to compile pipelines takes a software driver longer than most tests draw, so a test
//! borrows a renderer that another has given back, if one with the same options is idle.
//!
//! A renderer on loan has the settings of a new one. Its pictures are those of a new one too, which is a promise of the renderer that
//! tests hold it to (`nothing_of_a_frame_is_left_in_the_next` and others, with [`open`]); only the numbers of its frames go on. One
//! that a failed test held is closed.

use std::{
    collections::VecDeque,
    ops::{Deref, DerefMut},
    sync::{Mutex, PoisonError},
    thread,
};

use steradian::{
    gpu::{Gpu, GpuOptions},
    render::Renderer,
};

/// Renderers that nobody holds, the one idle for longest first.
pub struct Pool {
    idle: Mutex<VecDeque<(GpuOptions, Renderer)>>,
}

impl Pool {
    pub const fn new() -> Self {
        Self { idle: Mutex::new(VecDeque::new()) }
    }

    /// How many renderers may be idle: one for each test that runs at a time. Those on loan are as many as tests hold; were there
    /// a limit on them, tests that hold two could wait for each other forever.
    pub fn max_idle() -> usize {
        thread::available_parallelism().map_or(1, usize::from)
    }

    /// A renderer with these options: an idle one, or else a new one.
    pub fn lend(&'static self, options: &GpuOptions) -> Lent {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let found = idle.iter().rposition(|(of, _)| of == options).and_then(|index| idle.remove(index));
        drop(idle);
        let renderer = found.map_or_else(|| open(options), |(_, renderer)| renderer);
        Lent { pool: self, options: options.clone(), renderer: Some(renderer) }
    }

    /// Options of the idle renderers.
    pub fn idle(&self) -> Vec<GpuOptions> {
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        idle.iter().map(|(options, _)| options.clone()).collect()
    }

    fn take_back(&self, options: GpuOptions, renderer: Renderer) {
        let mut closed = Vec::new();
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        idle.push_back((options, renderer));
        while idle.len() > Self::max_idle() {
            closed.extend(idle.pop_front());
        }
        // Closing a device takes a while: not while others wait for the pool.
        drop(idle);
        drop(closed);
    }
}

/// A renderer on loan; it goes back to its pool when this is dropped.
pub struct Lent {
    pool: &'static Pool,
    options: GpuOptions,
    /// There until this is dropped.
    renderer: Option<Renderer>,
}

impl Deref for Lent {
    type Target = Renderer;

    fn deref(&self) -> &Renderer {
        self.renderer.as_ref().expect("drop alone takes it")
    }
}

impl DerefMut for Lent {
    fn deref_mut(&mut self) -> &mut Renderer {
        self.renderer.as_mut().expect("drop alone takes it")
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        // After a failure nobody knows what state the device is in.
        if thread::panicking() {
            return;
        }
        if let Some(mut renderer) = self.renderer.take() {
            renderer.culling = true;
            renderer.unit_factor = 1.0;
            renderer.catalogue_order = None;
            self.pool.take_back(self.options.clone(), renderer);
        }
    }
}

/// A new renderer. There is always an adapter where tests run: `make test` sees to it, and without one this fails.
pub fn open(options: &GpuOptions) -> Renderer {
    Renderer::new(Gpu::open(options).expect("tests need a Vulkan adapter; `make test` installs the software one"))
}
