//! The daemon's network side: the gRPC services of `proto/steradian/v1`, with health, server reflection and gRPC-Web on one
//! port, and the thread that owns the renderer.
//!
//! ```text
//! connections (tokio) --camera slot, bounded queue--> render thread (owns the Engine)
//! connections (tokio) <--latest-wins slots, replies-- render thread
//!                     `-- encoders on blocking threads
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
//! ends the daemon with an error.

mod client;
mod client_scene;
mod convert;
mod convert_objects;
mod engine;
mod frames;
mod handlers;
mod objects;
mod render;
mod scene;
mod schedule;
mod server;
mod slot;

pub use client::{
    CheckReceiver, Client, ClientError, FrameReceiver, ReceivedCheck, ReceivedFigure, ReceivedFrame, ReceivedImage,
    SceneForm, SceneReceiver, ServerInfo, ViewForm, ViewImageForm,
};
pub use engine::{Engine, EngineError};
pub use objects::{BodyForm, Change, FieldForm, ShapesForm};
pub use render::CameraUpdate;
pub use scene::SceneUpdate;
pub use server::{SceneCatalogue, ServeError, ServeOptions, Shutdown, run, signals};

/// Generated from `proto/steradian/v1`.
mod proto {
    #![allow(
        clippy::allow_attributes_without_reason,
        clippy::all,
        missing_docs,
        reason = "generated code follows its generator's rules"
    )]
    tonic::include_proto!("steradian.v1");

    /// The descriptors of every message and call, for server reflection.
    pub(super) const DESCRIPTORS: &[u8] = tonic::include_file_descriptor_set!("steradian_descriptors");
}
