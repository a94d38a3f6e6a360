//! Steradian renders one space scene in many views at once, each pixel with the luminance that its solid angle asks for.
//!
//! A frame flows one way through the modules, in the order in which they stand here:
//! `catalogue` and `config` make a `scene`; `view` turns configured views into a flat list of viewports; `plan` chooses a
//! method for each technique; `gpu` and `passes` draw; `reference` is the same in f64 on the CPU; `metrics` judges
//! images; `frame` runs it all; `verify` proves it and `chart` times and scores every method; `output`, `service` and `xr` hand
//! frames out. `docs/architecture.md` tells the whole story.

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

pub mod chart;
pub mod verify;

pub mod output;
pub mod service;
pub mod xr;

pub mod cli;
