//! Inner functions that run as programs of the runtime.

use std::{
    path::PathBuf,
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant, SystemTime},
};

use steradian::{
    render::Wanted,
    xr::{
        CapturedPixels, Flight, Headset, HeadsetFrame, HeadsetStatistics, Host, MirroredFrame, Recorder, Shown, Status,
        Step,
    },
};

use super::{
    shots::{Assignment, EyeBits, FOLDER_VARIABLE, Order, Taken, file},
    smoke::{FRAMES, Observations},
};
use crate::monado::{Remote, RemoteState};

/// Maximum time until a frame is shown.
const LIMIT: Duration = Duration::from_secs(60);

/// A host that provides the scene of an assignment, and keeps the published frames.
struct Photographer {
    shown: Mutex<Shown>,
    mirrors: AtomicBool,
    published: Mutex<Vec<MirroredFrame>>,
}

impl Photographer {
    fn new(assignment: &Assignment) -> Self {
        Self { shown: Mutex::new(shown(assignment)), mirrors: AtomicBool::new(false), published: Mutex::default() }
    }
}

fn shown(assignment: &Assignment) -> Shown {
    let (snapshot, settings) = assignment.load();
    Shown { snapshot, settings, camera_time: SystemTime::now() }
}

impl Host for Photographer {
    fn shown(&self) -> Option<Shown> {
        Some(self.shown.lock().unwrap().clone())
    }

    fn fly(&self, flight: &Flight) {
        panic!("the controllers are not used: {flight:?}");
    }

    fn mirror(&self) -> Wanted {
        let mirrors = self.mirrors.load(Ordering::Relaxed);
        Wanted { display: mirrors, hdr: mirrors, ..Wanted::default() }
    }

    fn publish(&self, frame: MirroredFrame) {
        self.published.lock().unwrap().push(frame);
    }

    fn status(&self, _: Status) {}

    fn statistics(&self, _: &HeadsetStatistics) {}
}

/// Steps the session until a frame was drawn.
fn drawn_frame(headset: &mut Headset, host: &Photographer) -> HeadsetFrame {
    let start = Instant::now();
    loop {
        assert!(start.elapsed() < LIMIT, "no frame was drawn; {:?}", headset.status());
        match headset.step(host).unwrap() {
            Step::Frame(frame) if frame.eyes.is_some() => return *frame,
            Step::Frame(_) | Step::Idle => {}
            step => panic!("the session is over: {step:?}"),
        }
    }
}

/// Takes the shots of an order.
pub fn photograph() {
    let folder = PathBuf::from(std::env::var_os(FOLDER_VARIABLE).unwrap());
    let order: Order = serde_json::from_slice(&std::fs::read(folder.join("order.json")).unwrap()).unwrap();
    let mut remote = Remote::connect(order.port).unwrap();
    let host = Photographer::new(&order.assignments[0]);
    let mut headset = Headset::connect(&order.settings, Recorder::default()).unwrap();
    let mut taken = Vec::new();
    for (shot, assignment) in order.assignments.iter().enumerate() {
        if shot > 0 {
            *host.shown.lock().unwrap() = shown(assignment);
        }
        // All poses that are queried from here on are those of this state.
        remote.send(&assignment.state).unwrap();
        headset.captures = true;
        host.mirrors.store(assignment.mirrored, Ordering::Relaxed);
        let frame = drawn_frame(&mut headset, &host);
        headset.captures = false;
        host.mirrors.store(false, Ordering::Relaxed);
        if assignment.mirrored {
            // Draw another frame, because a frame is finished only while the next one is rendered.
            drawn_frame(&mut headset, &host);
        }
        let published = std::mem::take(&mut *host.published.lock().unwrap());
        assert_eq!(published.len(), usize::from(assignment.mirrored), "the host requests one frame per shot");
        let images = frame.captured.unwrap();
        for (eye, image) in images.iter().enumerate() {
            let bytes = match &image.pixels {
                CapturedPixels::Linear(pixels) => le_bytes(pixels),
                CapturedPixels::Srgb8(pixels) => pixels.as_flattened().to_vec(),
            };
            std::fs::write(file(&folder, shot, eye, "image"), bytes).unwrap();
            if let Some(mirrored) = published.first() {
                let image = &mirrored.frame.images[eye];
                std::fs::write(file(&folder, shot, eye, "display"), image.display.as_ref().unwrap()).unwrap();
                std::fs::write(file(&folder, shot, eye, "hdr"), le_bytes(image.hdr.as_ref().unwrap())).unwrap();
            }
        }
        let eyes = frame.eyes.unwrap();
        assert_eq!(eyes.map(|eye| eye.size), [images[0].size, images[1].size]);
        taken.push(Taken {
            eyes: eyes.map(EyeBits::from),
            linear: matches!(images[0].pixels, CapturedPixels::Linear(_)),
            exposure_ev100: published.first().map(|mirrored| mirrored.frame.exposure_ev100.to_bits()),
        });
    }
    println!("{}", serde_json::to_string(&taken).unwrap());
}

fn le_bytes(pixels: &[[f32; 4]]) -> Vec<u8> {
    pixels.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Shows some hundred frames and ends the session in order.
pub fn show_frames() {
    let host = Photographer::new(&Assignment::new(RemoteState::default(), super::smoke::SCENE));
    let mut headset = Headset::connect(&Default::default(), Recorder::default()).unwrap();
    let mut observations = Observations::default();
    let start = Instant::now();
    while headset.recorder().figures().rendered < FRAMES {
        assert!(start.elapsed() < LIMIT, "{observations:?}");
        match headset.step(&host).unwrap() {
            Step::Frame(frame) => observations.frame(&frame),
            Step::Idle => {}
            step => panic!("the session is over: {step:?}"),
        }
        observations.status(headset.status());
    }
    headset.request_exit().unwrap();
    loop {
        assert!(start.elapsed() < LIMIT, "{observations:?}");
        match headset.step(&host).unwrap() {
            Step::Exited => break,
            Step::Frame(frame) => observations.frame(&frame),
            Step::Idle => {}
            Step::HostEnded => panic!("the host never ends"),
        }
        observations.status(headset.status());
    }
    observations.statistics(&headset.close().figures());
    println!("{}", serde_json::to_string(&observations).unwrap());
}
