//! The daemon's network side: the gRPC services of `proto/steradian/v1`, with health, server reflection and gRPC-Web on one
//! port, and the thread that owns the renderer.
//!
//! ```text
//! connections (tokio) --camera slot, bounded queue--> render thread (owns the Engine)
//! connections (tokio) <--latest-wins slots, replies-- render thread
//!                     `-- encoders on blocking threads
//! connections (tokio) <--latest-wins slots, replies-- headset thread (drives the headset, with a device of its own)
//! ```
//!
//! - [`run`] serves until SIGINT or SIGTERM and then drains.
//! - [`Engine`] is what renders: the GPU renderer, or a small one in tests.
//! - [`Client`] is the other end of the wire in plain Rust types.
//!
//! The camera is a slot: a pose that is overtaken before the next frame starts is never drawn. One frame serves
//! everyone who waits for one. What a client changes of the scene holds from the next frame on, for all views;
//! asteroids are placed on blocking threads. A slow client drops frames (counted) and never slows the renderer or
//! another client; a frame that fails fails for those who wait for it, and the daemon goes on; a renderer that panics
//! ends the daemon with an error. A headset is one more view, and nothing that happens to it concerns the others.

mod access;
mod answers;
mod audit;
mod background;
mod camera;
mod changes;
mod client;
mod client_camera;
mod client_scene;
mod client_stats;
mod clients;
mod connections;
mod convert;
mod convert_objects;
mod convert_observer;
mod convert_overlay;
mod convert_stats;
mod convert_views;
mod credentials;
mod diagnostics;
mod engine;
mod find;
mod forecast;
mod frames;
#[cfg(test)]
mod fuzz_tests;
mod handlers;
mod headset;
mod identify;
mod metrics;
mod objects;
mod observer;
mod order;
mod overlay;
mod page;
mod pull;
mod quality;
mod refusals;
mod render;
mod room;
mod scene;
mod schedule;
mod server;
mod slot;
mod state;
mod streams;
mod track;
mod video;
mod view_changes;
mod views;
mod windows;
mod worker;
mod workshop;

pub use access::{Access, AccessSource, Admitted, digest_of, new_token};
/// Target of the spans that tell where the time of frames, encodings and calls goes; logs have them where they are asked for.
pub const SPANS: &str = "steradian::spans";

pub use client::{
    After, CheckReceiver, Client, ClientError, FrameReceiver, HeadsetStatus, ReceivedAudits, ReceivedCheck,
    ReceivedFigure, ReceivedFrame, ReceivedHeadset, ReceivedImage, ReceivedImageAudit, ReceivedQuality, ReceivedStats,
    ReceivedTimes, ReceivedWindow, SceneForm, SceneReceiver, SeenKind, SeenObject, ServerInfo, StatsReceiver, ViewForm,
    ViewImageForm,
};
pub use client_camera::{CameraReceiver, Lease, Steering};
pub use credentials::Credentials;
pub use engine::{BesideEngine, Engine, EngineError, OpenBeside};
pub use headset::{Drive, HeadsetOptions};
pub use objects::{BodyForm, Change, FieldForm, ShapesForm};
pub use observer::{GroundForm, ObserverChange};
pub use overlay::OverlayChange;
pub use render::CameraUpdate;
pub use scene::SceneUpdate;
pub use server::{Address, Reloads, SceneCatalogue, ServeError, ServeOptions, Shutdown, check_listen, run, signals};
pub use state::StateError;
pub use views::{TableChange, ViewUpdate};
pub use windows::{OpenWindows, WindowsEnd, WindowsOptions};

use steradian_proto::v1 as proto;
