//! The daemon's network side: the gRPC services of `proto/steradian/v1`, with health, server reflection and gRPC-Web on one
//! port, and the thread that owns the renderer.
//!
//! ```text
//! connections (tokio) --newest camera, bounded queue--> render thread (owns the Engine)
//! connections (tokio) <--newest frames, replies-------- render thread
//!                     `-- encoders on blocking threads
//! connections (tokio) <--newest frames, replies-------- headset thread (drives the headset, with its own device)
//! ```
//!
//! - [`run`] serves until SIGINT or SIGTERM and then drains.
//! - [`Engine`] is the renderer: the GPU renderer, or a small one in tests.
//! - [`Client`] is the client side in plain Rust types.
//!
//! The modules, in the order in which they may import each other. Each imports only those above it; `tests/cpu/layering.rs`
//! checks that.
//!
//! | module | content |
//! |---|---|
//! | `threads` | thread priority, text of a panic |
//! | `time_source` | the time of the daemon, which never jumps |
//! | `scene` | the part of the scene that clients may change, in plain types: objects, observer, overlay, views, camera updates |
//! | `wire` | conversion between protobuf messages and plain types, error statuses with details |
//! | `state_file` | the file of acknowledged changes and snapshots |
//! | `network` | connections, limits per client, access (tokens, TLS, roles, log of changes), the web page |
//! | `frames` | subscriptions, the newest frame of each, pacing, encoders, video |
//! | `engine` | the render thread, its handle and queue, background jobs, quality levels, audits |
//! | `cluster` | several daemons in frame lock: the threads of a director and of a node, and the network |
//! | `displays` | the headset and the windows of the daemon's machine |
//! | `handlers` | the gRPC methods, and `/metrics` |
//! | `client` | the Rust client; imports only `scene` and `wire` |
//! | `daemon` | options, listening, start and shutdown |
//!
//! Frames use the newest camera: a pose that is replaced before the next frame starts is never drawn. One frame serves all clients that wait for one.
//! A change of the scene applies from the next frame on, for all views; asteroids are placed on blocking threads. A slow client drops frames
//! (counted) and never slows the renderer or another client. If a frame fails, only the clients that wait for it get an error, and the daemon
//! continues; a renderer that panics ends the daemon with an error. A headset is an additional view, and its failures do not affect the other views.

mod client;
pub mod cluster;
mod daemon;
mod displays;
mod engine;
mod frames;
#[cfg(test)]
mod fuzz_tests;
mod handlers;
mod network;
mod scene;
mod state_file;
mod threads;
mod time_source;
mod wire;

/// Target of the spans that measure frames, encodings and calls. Logs contain the spans on request.
pub const SPANS: &str = "steradian::spans";

pub use client::{
    camera::{CameraReceiver, Lease, Steering},
    connection::{After, Client, ClientError, FrameReceiver, ReceivedFrame, ReceivedImage, ServerInfo, ViewForm},
    credentials::Credentials,
    delivery::{Delivered, DeliveryError, DeliveryRound, LocalDaemon, measure_delivery, median_parts},
    director::{FoundDirector, FoundNode, ask_director},
    scene::{CheckReceiver, SceneForm, SceneReceiver, SeenKind, SeenObject},
    stats::StatsReceiver,
};
pub use daemon::{
    Address, EarlyServer, LimitOptions, NetworkOptions, Reloads, SceneOptions, ServeError, ServeOptions, Shutdown,
    StartProgress, ViewOptions, check_listen, run, signals,
};
pub use displays::{
    headset::{Drive, HeadsetOptions},
    windows::{OpenWindows, WindowsEnd, WindowsOptions},
};
pub use engine::interface::{BesideEngine, Engine, EngineError, OpenBeside};
pub use network::access::{Access, AccessSource, Admitted, Validity, digest_of, new_token};
pub use scene::{
    camera::CameraUpdate,
    objects::{BodyForm, Change},
    observer::{GroundForm, ObserverChange},
    overlay::{OverlayChange, PictureChange},
    state::{SceneCatalogue, SceneUpdate},
    views::{SettingsChange, ViewUpdate},
};
pub use state_file::{StateError, check_state};
pub use time_source::TimeSource;

pub use steradian_proto::v1 as proto;
