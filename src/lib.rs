//! Steradian renders one space scene in many views at once. Each pixel has the physically correct luminance for its
//! solid angle.
//!
//! Example: the bright stars in a planetarium dome. The image has the same total light as the catalogue:
//!
//! ```
//! use std::f64::consts::PI;
//! use steradian::{
//!     FrameRequest, Gpu, GpuOptions, RenderSettings, Renderer, Rig, SceneSnapshot, StarSet, View, ViewKind, Wanted,
//!     catalogue::bright::bright_stars, plan::settings::GlareSettings, units::illuminance_lx_from_magnitude,
//!     glam::{DQuat, DVec3},
//! };
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut stars = bright_stars(0.0);
//! stars.retain(|star| star.position.normalize().y > 0.1); // the zenith is at +y, the dome ends at 0
//! let catalogue_lx: f64 = stars.iter().map(|star| illuminance_lx_from_magnitude(star.apparent_magnitude())).sum();
//! let scene = SceneSnapshot::of_stars(StarSet::from_records(stars));
//!
//! let dome = ViewKind::DomeMaster { size: 512, fov_rad: PI, tilt_rad: 0.0 };
//! let rig = Rig::new(vec![View::new("dome", dome, DQuat::IDENTITY, DVec3::ZERO)?])?;
//! let settings = RenderSettings { glare: GlareSettings::none(), ..RenderSettings::default() };
//!
//! let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default())?);
//! let frame = renderer.render(FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::hdr()))?;
//! let picture_lx = frame.images[0].illuminance_lx().ok_or("there is no HDR image")?;
//! assert!((picture_lx / catalogue_lx - 1.0).abs() < 1e-4, "{picture_lx} lx, not {catalogue_lx} lx");
//! # Ok(())
//! # }
//! ```
//!
//! - A [`SceneSnapshot`] is the content: stars, bodies, asteroids, a camera. [`config::Config`] makes one from a file.
//! - A [`Rig`] is a flat list of [`View`]s: flat windows, eyes, cubes, domes, maps.
//! - A [`FrameRequest`] names both, with options; [`RenderSettings`] chooses a method for each technique.
//! - A [`Renderer`] owns a [`Gpu`] (hardware or software driver) and draws all views of a request into one [`Frame`].
//!
//! [`reference`](mod@reference) computes the same images in f64 on the CPU; [`metrics`] measures the accuracy of
//! images. `docs/architecture.md` explains the design.
//!
//! # Features
//!
//! All are on by default; without them no tonic, openxr or clap is compiled.
//!
//! | feature | adds |
//! |---|---|
//! | `service` | the module `service`: the daemon (gRPC) and its client |
//! | `cluster` | in the module `service::cluster`: the network between the daemons of a cluster |
//! | `xr` | in the module `xr`: driving an OpenXR headset |
//! | `windows` | in the module `windows`: opening windows on the monitors of this machine |
//! | `chart` | the module `chart`: speed and accuracy of all methods, as tables and pictures |
//! | `cli` | the program `steradian` with all of its subcommands; needs the others |

#[macro_use(named)]
extern crate steradian_sky;

pub use glam;

pub use steradian_render::{gpu, metrics, plan, reference, render, scene, view};
pub use steradian_sky::{
    cache, calendar, catalogue, coordinates, ephemeris, memory_size, observer, photometry, ranges, relativity,
    sky_pictures, solar_system, units,
};

pub use self::{
    catalogue::chunks::StarSet,
    gpu::{Gpu, GpuOptions},
    plan::settings::RenderSettings,
    render::{Frame, FrameRequest, RenderError, Renderer, Wanted},
    scene::{Camera, SceneSnapshot},
    view::{Rig, View, ViewKind},
};
use steradian_sky::{files, picture_file};

mod platform;

pub mod theatre;

pub mod config;

pub mod audit;
#[cfg(feature = "chart")]
pub mod chart;
pub mod verify;

pub mod output;
#[cfg(feature = "service")]
pub mod service;
#[cfg(any(feature = "service", feature = "windows"))]
pub mod windows;
#[cfg(any(feature = "service", feature = "xr"))]
pub mod xr;

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
