//! Types of views: each with its projections, sizes and eyes.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::{
    projection::{Face, FisheyeMapping, TabulatedMapping},
    projector::ProjectorOutput,
};

/// Signed angles of the four edges from the principal ray, rad, as in OpenXR (the left and lower ones are usually negative).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fov {
    /// To the left edge.
    pub left_rad: f64,
    /// To the right edge.
    pub right_rad: f64,
    /// To the upper edge.
    pub up_rad: f64,
    /// To the lower edge.
    pub down_rad: f64,
}

impl Fov {
    /// The mirrored field of view, which is that of the other eye.
    pub fn mirrored(self) -> Self {
        Self { left_rad: -self.right_rad, right_rad: -self.left_rad, ..self }
    }
}

/// An eye behind a lens of a headset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Width and height of its image, pixels.
    pub size: [u32; 2],
    /// Field of view.
    pub fov: Fov,
    /// Rotation from the eye's axes (+x right, +y up, looking -z) to those of the room.
    pub room_from_eye: DQuat,
    /// Position in the room, m.
    pub position_m: DVec3,
}

/// Projection and field of a view, before it is divided into images.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ViewKind {
    /// A symmetric flat window.
    Perspective {
        /// Width and height, pixels.
        size: [u32; 2],
        /// Vertical field of view, rad.
        fov_y_rad: f64,
    },
    /// A flat window with four independent edges.
    OffAxis {
        /// Width and height, pixels.
        size: [u32; 2],
        /// The edges.
        fov: Fov,
    },
    /// Two eyes.
    Stereo {
        /// Width and height per eye, pixels.
        size: [u32; 2],
        /// Distance between the eyes, m.
        ipd_m: f64,
        /// Edges of the left eye.
        fov_left: Fov,
        /// Edges of the right eye.
        fov_right: Fov,
    },
    /// The eyes of a headset, left and right, each with its own pose, in a room whose axes are those of the view.
    Headset {
        /// Left and right.
        eyes: [Eye; 2],
    },
    /// Square faces of 90 degrees.
    Cubemap {
        /// Side of a face, pixels.
        face_size: u32,
        /// Which faces are rendered.
        faces: Vec<Face>,
    },
    /// A round picture around -z.
    Fisheye {
        /// Width and height, pixels.
        size: [u32; 2],
        /// The mapping.
        mapping: FisheyeMapping,
        /// Field of view, rad.
        fov_rad: f64,
    },
    /// A planetarium domemaster: equidistant, centre = zenith, bottom = front.
    DomeMaster {
        /// Side of the square, pixels.
        size: u32,
        /// Field of view, rad.
        fov_rad: f64,
        /// Tilt of the dome towards the front, rad.
        tilt_rad: f64,
    },
    /// Omnidirectional stereo: a domemaster for each eye. Every direction appears as the eyes of a viewer who faces that direction would see it.
    StereoDome {
        /// Side of the square, pixels.
        size: u32,
        /// Field of view, rad.
        fov_rad: f64,
        /// Tilt of the dome towards the front, rad.
        tilt_rad: f64,
        /// Distance between the eyes, m.
        ipd_m: f64,
    },
    /// Longitude and latitude.
    Equirectangular {
        /// Width and height, pixels.
        size: [u32; 2],
    },
    /// A projector's raster.
    Projector {
        /// Directions of its pixels, [`Warp`](super::Warp) or another mapping.
        mapping: Arc<TabulatedMapping>,
        /// Processing of its picture.
        output: Arc<ProjectorOutput>,
    },
    /// A custom projection as a table; not available in configurations.
    Tabulated {
        /// The mapping.
        mapping: Arc<TabulatedMapping>,
    },
}

impl ViewKind {
    /// Processing of the picture, if the view is a projector.
    pub fn projector(&self) -> Option<&Arc<ProjectorOutput>> {
        match self {
            ViewKind::Projector { output, .. } => Some(output),
            _ => None,
        }
    }

    /// Name of the type in configurations.
    pub fn type_name(&self) -> &'static str {
        match self {
            ViewKind::Perspective { .. } | ViewKind::OffAxis { .. } => "perspective",
            ViewKind::Stereo { .. } => "stereo",
            ViewKind::Headset { .. } => "headset",
            ViewKind::Cubemap { .. } => "cubemap",
            ViewKind::Fisheye { .. } => "fisheye",
            ViewKind::DomeMaster { .. } | ViewKind::StereoDome { .. } => "dome_master",
            ViewKind::Equirectangular { .. } => "equirectangular",
            ViewKind::Projector { .. } => "projector",
            ViewKind::Tabulated { .. } => "tabulated",
        }
    }
}
