//! Renderers lent from a pool. With a software driver, opening a device and compiling pipelines takes longer than drawing in most tests, so a test
//! borrows an idle renderer with the same options that another test has returned.
//!
//! A borrowed renderer has the settings of a new one. Its pictures also equal those of a new one, which is a guarantee
//! of the renderer that tests check (`a_frame_does_not_depend_on_the_previous_frame` and others, with [`open`]); only its
//! frame numbers continue. A renderer held by a failed test is closed.

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

/// Idle renderers; the first one has been idle for longest.
pub struct Pool {
    idle: Mutex<VecDeque<(GpuOptions, Renderer)>>,
}

impl Pool {
    #[allow(clippy::new_without_default, reason = "a static needs a const constructor, and Default is not const")]
    pub const fn new() -> Self {
        Self { idle: Mutex::new(VecDeque::new()) }
    }

    /// Maximum number of idle renderers: one for each test that runs at a time. The number of borrowed renderers is not limited: with a limit, tests
    /// that hold two could wait for each other forever.
    pub fn max_idle() -> usize {
        thread::available_parallelism().map_or(1, usize::from)
    }

    /// Returns a renderer with these options: an idle one, or else a new one.
    pub fn lend(&'static self, options: &GpuOptions) -> Lent {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let found = idle.iter().rposition(|(known, _)| known == options).and_then(|index| idle.remove(index));
        drop(idle);
        let renderer = found.map_or_else(|| open(options), |(_, renderer)| renderer);
        Lent { pool: self, options: options.clone(), renderer: Some(renderer) }
    }

    /// Returns the options of the idle renderers.
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
        // Release the lock of the pool before closing renderers, which takes time.
        drop(idle);
        drop(closed);
    }
}

/// A borrowed renderer, returned to its pool on drop.
pub struct Lent {
    pool: &'static Pool,
    options: GpuOptions,
    /// Present until drop.
    renderer: Option<Renderer>,
}

impl Deref for Lent {
    type Target = Renderer;

    fn deref(&self) -> &Renderer {
        self.renderer.as_ref().expect("only drop takes it")
    }
}

impl DerefMut for Lent {
    fn deref_mut(&mut self) -> &mut Renderer {
        self.renderer.as_mut().expect("only drop takes it")
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        // After a failed test the state of the device is unknown, so do not return the renderer.
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

/// Opens a new renderer. Panics without an adapter; `make test` ensures that there is one.
pub fn open(options: &GpuOptions) -> Renderer {
    Renderer::new(Gpu::open(options).expect("tests need a Vulkan adapter; `make test` installs the software one"))
}
