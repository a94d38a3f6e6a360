//! The effect of a change on a scene's overlay.

use std::{path::Path, sync::Arc};

use super::objects::{Change, Objects};
use crate::{
    picture_file::PictureFile,
    scene::{
        SceneObjects,
        overlay::{
            Anchor, Grid, Label, Lists, MOST_PICTURE_TEXELS, MOST_PICTURES, Overlay, Picture, PictureLevels, Trajectory,
        },
    },
};

/// Maximum total size of the files of all pictures that clients have sent, bytes. The state file contains these files in every state.
pub(crate) const MOST_PNG_BYTES: usize = 2 << 20;

/// A picture of a change.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureChange {
    /// Unique among pictures.
    pub name: String,
    /// Its PNG; `None`: the PNG of the scene's picture of this name, which must exist.
    pub png: Option<Arc<[u8]>>,
    /// Direction of its centre.
    pub anchor: Anchor,
    /// Angle across its width, rad.
    pub width_rad: f64,
    /// Angle by which its top is turned to the left, rad.
    pub roll_rad: f64,
    /// Opacity, which multiplies its alpha.
    pub opacity: f64,
    /// Texels of the PNG, once it is decoded.
    decoded: Option<Arc<PictureLevels>>,
}

impl PictureChange {
    /// Creates a picture with a PNG; `None`: the PNG of the scene's picture of this name.
    pub fn new(name: impl Into<String>, png: Option<Vec<u8>>, anchor: Anchor, width_rad: f64) -> Self {
        let png = png.map(Arc::from);
        Self { name: name.into(), png, anchor, width_rad, roll_rad: 0.0, opacity: 1.0, decoded: None }
    }

    /// Returns the change that keeps an existing picture.
    fn kept(picture: &Picture) -> Self {
        let Picture { name, levels: _, png: _, anchor, width_rad, roll_rad, opacity } = picture.clone();
        Self { name, png: None, anchor, width_rad, roll_rad, opacity, decoded: None }
    }

    /// Returns the picture, with the texels of its PNG or of the existing picture of the same name.
    fn picture(&self, before: &[Picture]) -> Result<Picture, String> {
        let (levels, png) = match (&self.png, &self.decoded) {
            (Some(png), Some(levels)) => (Arc::clone(levels), Some(Arc::clone(png))),
            _ => {
                let same = before.iter().find(|picture| picture.name == self.name).ok_or_else(|| {
                    format!("overlay.pictures.{}.png: missing; the scene has no picture of this name", self.name)
                })?;
                (Arc::clone(&same.levels), same.png.clone())
            }
        };
        let Self { name, anchor, width_rad, roll_rad, opacity, .. } = self.clone();
        Ok(Picture { name, levels, png, anchor, width_rad, roll_rad, opacity })
    }

    /// Returns the picture with its PNG decoded.
    fn decoded(mut self) -> Result<Self, String> {
        if let Some(png) = &self.png {
            let place = format!("overlay.pictures.{}.png", self.name);
            let levels = PictureLevels::from_png_bytes(Path::new(&place), png).map_err(|error| error.to_string())?;
            self.decoded = Some(Arc::new(levels));
        }
        Ok(self)
    }
}

/// A change of an overlay; `None` and [`Change::Nothing`] keep a value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OverlayChange {
    /// Replaces all grids.
    pub grids: Option<Vec<Grid>>,
    /// Trajectories.
    pub trajectories: Change<Trajectory>,
    /// Labels.
    pub labels: Change<Label>,
    /// Pictures.
    pub pictures: Change<PictureChange>,
    /// Whether the points of the compass are written.
    pub cardinal_points: Option<bool>,
    /// Names of all views that show a test pattern.
    pub test_patterns: Option<Vec<String>>,
}

impl OverlayChange {
    /// Returns the change that produces this overlay from any other overlay whose pictures have these names and files.
    pub fn all(overlay: Overlay) -> Self {
        Self {
            grids: Some(overlay.grids),
            trajectories: Change::All(overlay.trajectories),
            labels: Change::All(overlay.labels),
            pictures: Change::All(overlay.pictures.iter().map(PictureChange::kept).collect()),
            cardinal_points: Some(overlay.cardinal_points),
            test_patterns: Some(overlay.test_patterns),
        }
    }

    /// Whether the change has no effect.
    pub fn is_nothing(&self) -> bool {
        self.grids.is_none()
            && self.trajectories.is_nothing()
            && self.labels.is_nothing()
            && self.pictures.is_nothing()
            && self.cardinal_points.is_none()
            && self.test_patterns.is_none()
    }

    /// Rejects test patterns of views that do not exist.
    pub(crate) fn check_views(&self, views: &[&str]) -> Result<(), String> {
        match self.test_patterns.iter().flatten().find(|name| !views.contains(&name.as_str())) {
            Some(name) => Err(format!("overlay.test_patterns: no view `{name}`: must be one of {}", views.join(", "))),
            None => Ok(()),
        }
    }

    /// Returns the change with the files of its pictures decoded. The sizes in their headers are checked before that.
    pub(crate) fn decoded(&self) -> Result<Self, String> {
        let given: Vec<&PictureChange> = match &self.pictures {
            Change::Nothing => return Ok(self.clone()),
            Change::All(all) => all.iter().collect(),
            Change::Named(named) => named.iter().filter_map(|(_, picture)| picture.as_ref()).collect(),
        };
        if given.len() > MOST_PICTURES {
            return Err(format!("overlay.pictures: {} pictures: there must be at most {MOST_PICTURES}", given.len()));
        }
        let pngs = || given.iter().filter_map(|picture| picture.png.as_deref());
        let texels = pngs().filter_map(PictureFile::size_of).map(|[width, height]| width as usize * height as usize);
        let texels = texels.fold(0, usize::saturating_add);
        if texels > MOST_PICTURE_TEXELS {
            return Err(format!(
                "overlay.pictures: {texels} texels in all pictures: there must be at most {MOST_PICTURE_TEXELS}"
            ));
        }
        check_bytes(pngs().map(<[u8]>::len).sum())?;
        Ok(Self { pictures: self.pictures.map(|picture| picture.clone().decoded())?, ..self.clone() })
    }

    fn applied(&self, overlay: &Overlay) -> Result<Overlay, String> {
        let before: Vec<PictureChange> = overlay.pictures.iter().map(PictureChange::kept).collect();
        let pictures = self.pictures.applied(&before, "overlay.pictures", |one| &one.name)?;
        let pictures = pictures.iter().map(|picture| picture.picture(&overlay.pictures));
        let pictures = pictures.collect::<Result<Vec<_>, _>>()?;
        check_bytes(pictures.iter().filter_map(|picture| picture.png.as_ref()).map(|png| png.len()).sum())?;
        let applied = Overlay {
            pictures,
            grids: self.grids.clone().unwrap_or_else(|| overlay.grids.clone()),
            trajectories: self.trajectories.applied(&overlay.trajectories, "overlay.trajectories", |one| &one.name)?,
            labels: self.labels.applied(&overlay.labels, "overlay.labels", |one| &one.name)?,
            cardinal_points: self.cardinal_points.unwrap_or(overlay.cardinal_points),
            test_patterns: self.test_patterns.clone().unwrap_or_else(|| overlay.test_patterns.clone()),
        };
        applied.check().map_err(|wrong| {
            let name = match wrong.list {
                Lists::Grids => None,
                Lists::Pictures => applied.pictures.get(wrong.index).map(|one| &one.name),
                Lists::Trajectories => applied.trajectories.get(wrong.index).map(|one| &one.name),
                Lists::Labels => applied.labels.get(wrong.index).map(|one| &one.name),
            };
            match name {
                Some(name) => format!("overlay.{}.{name}: {}", wrong.list.key(), wrong.error),
                None => wrong.to_string(),
            }
        })?;
        Ok(applied)
    }
}

/// Checks that PNG files have no more bytes than a scene may have.
fn check_bytes(bytes: usize) -> Result<(), String> {
    match bytes > MOST_PNG_BYTES {
        true => {
            Err(format!("overlay.pictures: {bytes} bytes in all PNG files: there must be at most {MOST_PNG_BYTES}"))
        }
        false => Ok(()),
    }
}

impl Objects {
    /// Returns the objects with the changed overlay.
    pub(crate) fn with_overlay(mut self, change: &OverlayChange) -> Result<Self, String> {
        if change.is_nothing() {
            return Ok(self);
        }
        let overlay = Arc::new(change.applied(&self.drawn.overlay)?);
        let checked = overlay.check_observer(self.drawn.observer.is_some());
        checked.map_err(|(key, problem)| format!("overlay.{key}: {problem}"))?;
        self.drawn = Arc::new(SceneObjects { overlay, ..(*self.drawn).clone() });
        Ok(self)
    }
}
