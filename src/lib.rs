//! Steradian renders one space scene in many views at once, each pixel with the luminance that its solid angle asks for.
//!
//! A frame flows one way through the modules, in the order in which they stand here:
//! `catalogue` and `config` make a `scene`; `view` turns configured views into a flat list of viewports; `plan` chooses a
//! method for each technique; `gpu` and `passes` draw; `reference` is the same in f64 on the CPU; `metrics` judges
//! images; `frame` runs it all; `verify` proves it and `chart` times and scores every method; `output`, `service` and `xr` hand
//! frames out. `docs/architecture.md` tells the whole story.

pub use self::{
    catalogue::chunks::StarSet,
    gpu::{Gpu, GpuOptions},
    plan::settings::RenderSettings,
    render::{Frame, FrameRequest, RenderError, Renderer, Wanted},
    scene::{Camera, SceneSnapshot},
    view::{Rig, View, ViewKind},
};

pub mod coordinates;
mod files;
pub mod units;

pub mod photometry;

pub mod relativity;

pub mod catalogue;

pub mod scene;
pub mod view;

pub mod plan;

pub mod config;

pub mod gpu;

pub mod metrics;

pub mod reference;

pub mod render;

#[cfg(feature = "chart")]
pub mod chart;
pub mod verify;

pub mod output;
#[cfg(feature = "service")]
pub mod service;
#[cfg(any(feature = "service", feature = "xr"))]
pub mod xr;

#[cfg(feature = "cli")]
pub mod cli;
