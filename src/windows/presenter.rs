//! The presenting thread: shows one frame at a time in all windows.
//!
//! The images of a frame are uploaded to the device first. Then the thread waits for every window's next texture, draws all windows in one
//! submission, and presents them one after the other. If images wait for refreshes, the slowest monitor determines the pace of all windows.
//!
//! A host may separate preparation and presentation: it has a frame prepared (uploaded, the device polled, the next textures acquired), and has it
//! presented later, or not at all. A texture that was acquired for a frame that is not presented is kept for the next one, because Vulkan cannot
//! return it.

use std::{
    collections::HashMap,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use super::{
    WindowsError,
    adapter::WindowGpu,
    desk::{Desk, DeskState, DeskWindow},
    host::{Host, Next, WindowFrame, WindowImage},
    picture::{Picture, Pipelines},
    pixels::texels,
    plate::PlateText,
    recorder::Recorder,
    screen::{Screen, Shown},
    statistics::{WindowFigures, WindowState},
};
use crate::config::WindowConfig;

/// Interval between checks for windows while there are none.
const IDLE: Duration = Duration::from_millis(20);
/// Maximum number of consecutive attempts to reopen the device without a frame.
const MOST_LOSSES: u32 = 3;
/// Log target of presented frames: one line per frame, with its number in each window.
const PRESENTED: &str = "steradian::windows::presented";

/// State of a window in this thread.
#[derive(Default)]
struct Place {
    screen: Option<Screen>,
    recorder: Recorder,
    /// Content that was presented last, with the value of the stale counter at that time.
    presented: Option<(Shown, u64)>,
    /// Whether its view no longer exists.
    no_view: bool,
    /// Whether the host wants it black.
    is_black: bool,
    /// Reason why it cannot be shown at all.
    refused: Option<String>,
}

/// An image of a prepared frame.
enum Prepared {
    Picture { picture: Box<Picture>, number: u64 },
    NoView,
    Black,
}

/// A window that is drawn and presented, with its content and the number of its new frame.
type Due = (usize, Shown, Option<u64>);

pub(super) struct Presenter {
    configs: Vec<WindowConfig>,
    host: Arc<dyn Host>,
    desk: Arc<Desk>,
    /// Name of the adapter to use if it can present.
    preferred: String,
    gpu: Option<WindowGpu>,
    pipelines: Pipelines,
    places: Vec<Place>,
    /// Images of the prepared frames, by the number of the frame and the index of the window.
    prepared: HashMap<u64, Vec<(usize, Prepared)>>,
    /// Number of losses of the device since the last presented frame.
    losses: u32,
}

impl Presenter {
    pub(super) fn new(configs: Vec<WindowConfig>, host: Arc<dyn Host>, desk: Arc<Desk>, preferred: String) -> Self {
        let places = configs.iter().map(|_| Place::default()).collect();
        Self {
            configs,
            host,
            desk,
            preferred,
            gpu: None,
            pipelines: Pipelines::default(),
            places,
            prepared: HashMap::new(),
            losses: 0,
        }
    }

    /// Shows frames until the host or the event loop ends it.
    ///
    /// # Errors
    ///
    /// No window can be shown, or the device of the windows failed.
    pub(super) fn run(mut self) -> Result<(), WindowsError> {
        let end = self.show();
        if let Err(error) = &end {
            // The event thread may have ended already, so report the state here.
            let state = || WindowState::NoDisplay(error.to_string());
            let figures = self.figures(&self.desk.state().clone()).into_iter();
            self.host.figures(figures.map(|figures| WindowFigures { state: state(), ..figures }).collect());
        }
        end
    }

    fn show(&mut self) -> Result<(), WindowsError> {
        while !self.desk.has_ended() {
            let desk = self.desk.state().clone();
            let shown: Vec<bool> = self.is_shown(&desk);
            let next = self.host.next(&shown);
            let brings_frame = matches!(next, Next::Frame(_));
            // Read the state again, because it may have changed during the wait.
            let desk = self.desk.state().clone();
            let done = match next {
                Next::End => break,
                Next::Frame(frame) => self.present(&desk, Some(&frame)),
                Next::Drawing => self.present(&desk, None),
                Next::Unchanged => {
                    self.places.iter_mut().for_each(|place| place.recorder.pause());
                    self.present(&desk, None)
                }
                Next::Prepare(number, frame) => {
                    let done = self.prepare(&desk, number, &frame);
                    self.host.prepared(number, done.is_ok());
                    match done {
                        Ok(()) => continue,
                        Err(error) => Err(error),
                    }
                }
                Next::Present(number) => self.present_prepared(&desk, number),
                Next::Discard(number) => {
                    self.discard(number);
                    continue;
                }
            };
            let presented = match done {
                Err(WindowsError::Refused(problem)) if self.losses < MOST_LOSSES => {
                    self.lose(&problem);
                    continue;
                }
                presented => presented?,
            };
            if presented {
                self.losses = 0;
            }
            if presented || !brings_frame {
                self.host.figures(self.figures(&desk));
            }
            if !presented && !shown.contains(&true) {
                thread::sleep(IDLE);
            }
        }
        Ok(())
    }

    /// Drops the device and everything on it; the next frame reopens it.
    fn lose(&mut self, problem: &str) {
        self.losses += 1;
        tracing::error!("the adapter of the windows refused a frame, so it is reopened: {problem}");
        for place in &mut self.places {
            (place.screen, place.presented) = (None, None);
        }
        self.prepared.clear();
        self.pipelines = Pipelines::default();
        self.gpu = None;
    }

    fn is_shown(&self, desk: &DeskState) -> Vec<bool> {
        let is_visible = |(window, place): (&DeskWindow, &Place)| window.shown && place.refused.is_none();
        desk.windows.iter().zip(&self.places).map(is_visible).collect()
    }

    /// Opens and resizes the surfaces of all visible windows; returns the indices of those that can be drawn.
    fn ready_windows(&mut self, desk: &DeskState) -> Result<Vec<usize>, WindowsError> {
        let shown = self.is_shown(desk);
        let mut ready = Vec::new();
        for (index, window) in desk.windows.iter().enumerate() {
            if !shown[index] {
                self.places[index].recorder.pause();
                self.places[index].presented = None;
                continue;
            }
            let Some(of_window) = window.window.clone() else { continue };
            let is_new = self.places[index].screen.as_ref().is_none_or(|screen| !screen.is_of(&of_window));
            if is_new && !self.open_screen(index, window)? {
                continue;
            }
            let (Some(gpu), Some(screen)) = (&self.gpu, &mut self.places[index].screen) else { continue };
            screen.resize(gpu, window.size);
            ready.push(index);
        }
        Ok(ready)
    }

    /// Updates all windows for which the frame has an image or whose picture is stale. Returns whether there was such a window.
    fn present(&mut self, desk: &DeskState, frame: Option<&WindowFrame>) -> Result<bool, WindowsError> {
        let mut due = Vec::new();
        for index in self.ready_windows(desk)? {
            let place = &mut self.places[index];
            let (Some(gpu), Some(screen)) = (&self.gpu, &mut place.screen) else { continue };
            let mut number = None;
            match frame.and_then(|frame| frame.images.get(index)) {
                Some(WindowImage::Image(image)) => {
                    let (shown, format) = (image.image(), self.configs[index].format);
                    if let Some(texels) = texels(shown, image.frame.exposure_ev100, &image.tone_map, format) {
                        screen.fill(gpu, [shown.width, shown.height], &texels);
                        number = Some(image.frame.number);
                        (place.no_view, place.is_black) = (false, false);
                    }
                }
                Some(WindowImage::NoView) => place.no_view = true,
                Some(WindowImage::Black) => place.is_black = true,
                Some(WindowImage::AsBefore) | None => {}
            }
            due.extend(self.due(desk, index, number));
        }
        self.present_together(desk, due)
    }

    /// Prepares a frame: uploads its images, acquires the next textures of all windows, and waits for the device.
    fn prepare(&mut self, desk: &DeskState, number: u64, frame: &WindowFrame) -> Result<(), WindowsError> {
        let mut prepared = Vec::new();
        for index in self.ready_windows(desk)? {
            let (Some(gpu), Some(screen)) = (&self.gpu, &mut self.places[index].screen) else { continue };
            match frame.images.get(index) {
                Some(WindowImage::Image(image)) => {
                    let (shown, format) = (image.image(), self.configs[index].format);
                    if let Some(texels) = texels(shown, image.frame.exposure_ev100, &image.tone_map, format) {
                        let picture = screen.upload(gpu, [shown.width, shown.height], &texels);
                        prepared.push((
                            index,
                            Prepared::Picture { picture: Box::new(picture), number: image.frame.number },
                        ));
                    }
                }
                Some(WindowImage::NoView) => prepared.push((index, Prepared::NoView)),
                Some(WindowImage::Black) => prepared.push((index, Prepared::Black)),
                Some(WindowImage::AsBefore) | None => {}
            }
            screen.acquire_ahead(gpu);
        }
        self.prepared.insert(number, prepared);
        self.gpu.as_ref().map_or(Ok(()), WindowGpu::finish)
    }

    /// Presents a prepared frame, and every window whose picture is stale.
    fn present_prepared(&mut self, desk: &DeskState, number: u64) -> Result<bool, WindowsError> {
        // The device may have been lost since it was prepared.
        let mut prepared = self.prepared.remove(&number).unwrap_or_default();
        let mut due = Vec::new();
        for index in self.ready_windows(desk)? {
            let place = &mut self.places[index];
            let Some(screen) = &mut place.screen else { continue };
            let mut number = None;
            match prepared.iter().position(|(of, _)| *of == index).map(|found| prepared.swap_remove(found)) {
                Some((_, Prepared::Picture { picture, number: of_frame })) => {
                    screen.put(*picture);
                    number = Some(of_frame);
                    (place.no_view, place.is_black) = (false, false);
                }
                Some((_, Prepared::NoView)) => place.no_view = true,
                Some((_, Prepared::Black)) => place.is_black = true,
                None => {}
            }
            due.extend(self.due(desk, index, number));
        }
        self.present_together(desk, due)
    }

    /// Keeps the textures of a prepared frame for another one.
    fn discard(&mut self, number: u64) {
        for (index, image) in self.prepared.remove(&number).unwrap_or_default() {
            if let (Prepared::Picture { picture, .. }, Some(screen)) = (image, &mut self.places[index].screen) {
                screen.take_back(*picture);
            }
        }
    }

    /// Returns the content that a window must show with this new frame; `None` if it shows that content already.
    fn due(&self, desk: &DeskState, index: usize, number: Option<u64>) -> Option<Due> {
        let place = &self.places[index];
        let black = desk.blackout || place.no_view || place.is_black;
        let shown = Shown { black, plate: self.plate(desk, index) };
        let up_to_date = place.presented.as_ref() == Some(&(shown.clone(), desk.windows[index].stale));
        (number.is_some() || !up_to_date).then_some((index, shown, number))
    }

    fn present_together(&mut self, desk: &DeskState, due: Vec<Due>) -> Result<bool, WindowsError> {
        let Some(gpu) = self.gpu.as_ref().filter(|_| !due.is_empty()) else { return Ok(false) };
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("windows") });
        let mut drawn = Vec::new();
        for (index, shown, number) in due {
            let Some(screen) = &mut self.places[index].screen else { continue };
            let Some(target) = screen.acquire(gpu) else { continue };
            screen.draw(gpu, &mut self.pipelines, &mut encoder, &target.texture, &shown);
            drawn.push((index, shown, number, target));
        }
        gpu.queue.submit([encoder.finish()]);
        let mut numbers = Vec::new();
        let any = !drawn.is_empty();
        for (index, shown, number, target) in drawn {
            let (window, place) = (&desk.windows[index], &mut self.places[index]);
            if let Some(screen) = &place.screen {
                screen.about_to_present();
            }
            gpu.queue.present(target);
            place.presented = Some((shown, window.stale));
            if let Some(number) = number {
                let period = window.refresh_hz.filter(|_| self.configs[index].vsync);
                let period = period.and_then(|rate| Duration::try_from_secs_f64(1.0 / rate).ok());
                place.recorder.presented(Instant::now(), number, period);
                numbers.push((index, number));
            }
        }
        if !numbers.is_empty() {
            tracing::trace!(target: PRESENTED, "{}", self.presented_line(&numbers));
        }
        gpu.take_failure()?;
        Ok(any)
    }

    fn presented_line(&self, numbers: &[(usize, u64)]) -> String {
        let entry = |(index, number): &(usize, u64)| format!("{} {number}", self.configs[*index].name);
        numbers.iter().map(entry).collect::<Vec<_>>().join(", ")
    }

    /// Creates the surface of a window; returns `false` if this window cannot be shown but others can.
    fn open_screen(&mut self, index: usize, window: &DeskWindow) -> Result<bool, WindowsError> {
        let config = &self.configs[index];
        let Some(of_window) = window.window.clone() else { return Ok(false) };
        self.places[index].screen = None;
        let opened = match &self.gpu {
            Some(gpu) => gpu.surface(Arc::clone(&of_window), &config.name),
            None => WindowGpu::open(Arc::clone(&of_window), &config.name, &self.preferred).map(|(gpu, surface)| {
                self.gpu = Some(gpu);
                surface
            }),
        };
        let Some(gpu) = &self.gpu else { return opened.map(|_| false) };
        let screen = opened.and_then(|surface| Screen::new(gpu, surface, of_window, config, window.size));
        match screen {
            Ok(screen) => {
                self.places[index].screen = Some(screen);
                Ok(true)
            }
            Err(error) => {
                // If this is the only window, nothing could ever be shown.
                let others =
                    self.places.iter().enumerate().any(|(other, place)| other != index && place.refused.is_none());
                if !others {
                    return Err(error);
                }
                tracing::error!("{error}; the other windows continue");
                self.places[index].refused = Some(error.to_string());
                Ok(false)
            }
        }
    }

    /// Returns the text that identifies a window: number and name, view and part if they differ from the name, and
    /// monitor.
    fn plate(&self, desk: &DeskState, index: usize) -> Option<PlateText> {
        let (config, window) = (&self.configs[index], &desk.windows[index]);
        desk.identify.then(|| {
            let mut lines = vec![format!("{} {}", index + 1, config.name)];
            let view =
                config.part.as_ref().map_or_else(|| config.view.clone(), |part| format!("{} {part}", config.view));
            if view != config.name {
                lines.push(view);
            }
            if !window.monitor.is_empty() {
                lines.push(window.monitor.clone());
            }
            PlateText { lines, window: window.size }
        })
    }

    fn figures(&self, desk: &DeskState) -> Vec<WindowFigures> {
        let all = self.configs.iter().zip(&self.places).zip(&desk.windows);
        let figures = |((config, place), window): ((&WindowConfig, &Place), &DeskWindow)| {
            let state = match &place.refused {
                Some(reason) => WindowState::NoDisplay(reason.clone()),
                None if place.no_view && window.state == WindowState::Shown => WindowState::ViewMissing,
                None => window.state.clone(),
            };
            let Recorder { frames, missed, frame_number, .. } = place.recorder;
            WindowFigures {
                monitor: window.monitor.clone(),
                refresh_hz: window.refresh_hz,
                frame_number,
                frames,
                intervals: place.recorder.intervals(),
                missed: (config.vsync && window.refresh_hz.is_some()).then_some(missed),
                ..WindowFigures::new(&config.name, &config.view, config.part.as_deref().unwrap_or_default(), state)
            }
        };
        all.map(figures).collect()
    }
}
