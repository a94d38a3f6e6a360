//! Overlays: conversion between protobuf messages and plain types. Errors state the problem and the valid values.

use glam::DVec3;

use super::{
    camera::{vector_from_pb, vector_to_pb},
    objects::{add_change, change_to_pb},
};
use crate::{
    scene::overlay::{Anchor, Colour, Grid, GridKind, Label, LineStyle, Overlay, Picture, Trajectory},
    service::{
        proto,
        scene::overlay::{OverlayChange, PictureChange},
    },
};

fn style_to_pb(style: &LineStyle) -> proto::LineStyle {
    proto::LineStyle {
        colour: Some(style.colour.to_hex()),
        width_px: Some(style.width_px),
        opacity: Some(style.opacity),
    }
}

fn colour_from_pb(colour: Option<String>, default: Colour) -> Result<Colour, String> {
    let given = colour.map(|text| Colour::from_hex(&text).map_err(|problem| format!("colour: {problem}")));
    given.unwrap_or(Ok(default))
}

fn style_from_pb(style: Option<proto::LineStyle>, default: LineStyle) -> Result<LineStyle, String> {
    let style = style.unwrap_or_default();
    Ok(LineStyle {
        colour: colour_from_pb(style.colour, default.colour)?,
        width_px: style.width_px.unwrap_or(default.width_px),
        opacity: style.opacity.unwrap_or(default.opacity),
    })
}

fn grid_to_pb(grid: &Grid) -> proto::Grid {
    proto::Grid {
        kind: grid.kind.name().to_owned(),
        spacing_deg: Some(grid.spacing_deg),
        numbers: Some(grid.numbers),
        style: Some(style_to_pb(&grid.style())),
    }
}

/// Reads a grid without checking ranges.
fn grid_from_pb(grid: proto::Grid) -> Result<Grid, String> {
    let kind = GridKind::from_name(&grid.kind).ok_or_else(|| {
        let names = GridKind::ALL.map(GridKind::name).join(", ");
        format!("kind = `{}`: must be one of {names}", grid.kind)
    })?;
    let LineStyle { colour, width_px, opacity } = style_from_pb(grid.style, Grid::STYLE)?;
    let spacing_deg = grid.spacing_deg.unwrap_or(Grid::SPACING_DEG);
    Ok(Grid { kind, spacing_deg, numbers: grid.numbers.unwrap_or(true), colour, width_px, opacity })
}

fn trajectory_to_pb(trajectory: &Trajectory) -> proto::Trajectory {
    proto::Trajectory {
        name: trajectory.name.clone(),
        points_m: trajectory.points_m.iter().copied().map(vector_to_pb).collect(),
        style: Some(style_to_pb(&trajectory.style())),
    }
}

/// Reads a trajectory without checking ranges.
fn trajectory_from_pb(trajectory: proto::Trajectory) -> Result<Trajectory, String> {
    let point = |point| DVec3::from_array(vector_from_pb(point));
    let style = style_from_pb(trajectory.style, Trajectory::STYLE)?;
    Ok(Trajectory::new(trajectory.name, trajectory.points_m.into_iter().map(point).collect(), style))
}

fn label_to_pb(label: &Label) -> proto::Label {
    use proto::label::Anchor as Wire;
    proto::Label {
        name: label.name.clone(),
        text: label.text.clone(),
        anchor: Some(match label.anchor {
            Anchor::Direction(direction) => Wire::Direction(vector_to_pb(direction)),
            Anchor::Point(point_m) => Wire::PositionM(vector_to_pb(point_m)),
            Anchor::Horizon([azimuth_rad, altitude_rad]) => Wire::Horizon(proto::HorizonPoint {
                azimuth_deg: azimuth_rad.to_degrees(),
                altitude_deg: altitude_rad.to_degrees(),
            }),
        }),
        colour: Some(label.colour.to_hex()),
        size_px: Some(label.size_px),
        opacity: Some(label.opacity),
    }
}

/// Reads a label without checking ranges.
fn label_from_pb(label: proto::Label) -> Result<Label, String> {
    use proto::label::Anchor as Wire;
    let anchor = match label.anchor.ok_or("direction, position_m or horizon is missing")? {
        Wire::Direction(direction) => {
            Label::direction(DVec3::from_array(vector_from_pb(direction))).map_err(|error| error.to_string())?
        }
        Wire::PositionM(point) => Anchor::Point(DVec3::from_array(vector_from_pb(point))),
        Wire::Horizon(place) => Anchor::Horizon([place.azimuth_deg, place.altitude_deg].map(f64::to_radians)),
    };
    Ok(Label {
        text: if label.text.is_empty() { label.name.clone() } else { label.text },
        name: label.name,
        anchor,
        colour: colour_from_pb(label.colour, Label::COLOUR)?,
        size_px: label.size_px.unwrap_or(Label::SIZE_PX),
        opacity: label.opacity.unwrap_or(1.0),
    })
}

/// Writes a picture without its file.
fn picture_to_pb(picture: &Picture) -> proto::OverlayPicture {
    let Picture { name, levels, png: _, anchor, width_rad, roll_rad, opacity } = picture;
    let size = levels.size().to_vec();
    proto::OverlayPicture { size, ..placed_to_pb(name, *anchor, [*width_rad, *roll_rad], *opacity) }
}

fn picture_change_to_pb(picture: &PictureChange) -> proto::OverlayPicture {
    let PictureChange { name, png, anchor, width_rad, roll_rad, opacity, .. } = picture;
    let png = png.as_ref().map(|png| png.to_vec());
    proto::OverlayPicture { png, ..placed_to_pb(name, *anchor, [*width_rad, *roll_rad], *opacity) }
}

fn placed_to_pb(name: &str, anchor: Anchor, angles_rad: [f64; 2], opacity: f64) -> proto::OverlayPicture {
    use proto::overlay_picture::Anchor as Wire;
    let [width_deg, roll_deg] = angles_rad.map(f64::to_degrees);
    let anchor = match anchor {
        Anchor::Direction(direction) => Some(Wire::Direction(vector_to_pb(direction))),
        Anchor::Horizon([azimuth_rad, altitude_rad]) => Some(Wire::Horizon(proto::HorizonPoint {
            azimuth_deg: azimuth_rad.to_degrees(),
            altitude_deg: altitude_rad.to_degrees(),
        })),
        // Pictures have directions, not positions.
        Anchor::Point(_) => None,
    };
    let (name, opacity) = (name.to_owned(), Some(opacity));
    proto::OverlayPicture { name, png: None, anchor, width_deg, roll_deg, opacity, size: Vec::new() }
}

/// Reads a picture without checking ranges, and without decoding its file.
fn picture_from_pb(picture: proto::OverlayPicture) -> Result<PictureChange, String> {
    use proto::overlay_picture::Anchor as Wire;
    let anchor = match picture.anchor.ok_or("direction or horizon is missing")? {
        Wire::Direction(direction) => {
            Label::direction(DVec3::from_array(vector_from_pb(direction))).map_err(|error| error.to_string())?
        }
        Wire::Horizon(place) => Anchor::Horizon([place.azimuth_deg, place.altitude_deg].map(f64::to_radians)),
    };
    let mut change = PictureChange::new(picture.name, picture.png, anchor, picture.width_deg.to_radians());
    change.roll_rad = picture.roll_deg.to_radians();
    change.opacity = picture.opacity.unwrap_or(1.0);
    Ok(change)
}

pub(crate) fn overlay_to_pb(overlay: &Overlay) -> proto::Overlay {
    proto::Overlay {
        grids: overlay.grids.iter().map(grid_to_pb).collect(),
        trajectories: overlay.trajectories.iter().map(trajectory_to_pb).collect(),
        labels: overlay.labels.iter().map(label_to_pb).collect(),
        cardinal_points: overlay.cardinal_points,
        test_patterns: overlay.test_patterns.clone(),
        pictures: overlay.pictures.iter().map(picture_to_pb).collect(),
    }
}

fn grids_from_pb(grids: Vec<proto::Grid>) -> Result<Vec<Grid>, String> {
    let grid = |(index, grid)| grid_from_pb(grid).map_err(|problem| format!("overlay.grids[{index}]: {problem}"));
    grids.into_iter().enumerate().map(grid).collect()
}

/// Reads an overlay without checking ranges, and without its pictures, whose files the message lacks.
pub(crate) fn overlay_from_pb(overlay: proto::Overlay) -> Result<Overlay, String> {
    Ok(Overlay {
        pictures: Vec::new(),
        grids: grids_from_pb(overlay.grids)?,
        trajectories: overlay.trajectories.into_iter().map(trajectory_from_pb).collect::<Result<_, _>>()?,
        labels: overlay.labels.into_iter().map(label_from_pb).collect::<Result<_, _>>()?,
        cardinal_points: overlay.cardinal_points,
        test_patterns: overlay.test_patterns,
    })
}

/// Reads the part that a mask's path names. `rest` is the path after `overlay`: empty or `.PART`. Returns false if the
/// path does not exist.
pub(crate) fn add_overlay_change(
    change: &mut OverlayChange,
    rest: &str,
    given: Option<&proto::Overlay>,
) -> Result<bool, String> {
    let none = proto::Overlay::default();
    let given = given.unwrap_or(&none);
    if rest.is_empty() {
        if !change.is_nothing() {
            return Err(
                "update_mask: `overlay` names the whole overlay: use either this path, or parts below it".to_owned()
            );
        }
        for part in [".grids", ".trajectories", ".labels", ".pictures", ".cardinal_points", ".test_patterns"] {
            add_overlay_change(change, part, Some(given))?;
        }
        return Ok(true);
    }
    let below = |list: &str| rest.strip_prefix(list).filter(|rest| rest.is_empty() || rest.starts_with('.'));
    let twice = || Err(format!("update_mask: `overlay{rest}` is named twice"));
    if let Some(rest) = below(".trajectories") {
        let (key, trajectories) = ("overlay.trajectories", &given.trajectories);
        add_change(&mut change.trajectories, key, rest, trajectories, |one| &one.name, trajectory_from_pb)?;
    } else if let Some(rest) = below(".labels") {
        let (key, labels) = ("overlay.labels", &given.labels);
        add_change(&mut change.labels, key, rest, labels, |one| &one.name, label_from_pb)?;
    } else if let Some(rest) = below(".pictures") {
        let (key, pictures) = ("overlay.pictures", &given.pictures);
        add_change(&mut change.pictures, key, rest, pictures, |one| &one.name, picture_from_pb)?;
    } else if rest == ".grids" {
        if change.grids.replace(grids_from_pb(given.grids.clone())?).is_some() {
            return twice();
        }
    } else if rest == ".cardinal_points" {
        if change.cardinal_points.replace(given.cardinal_points).is_some() {
            return twice();
        }
    } else if rest == ".test_patterns" {
        if change.test_patterns.replace(given.test_patterns.clone()).is_some() {
            return twice();
        }
    } else {
        return Ok(false);
    }
    Ok(true)
}

/// Returns the paths and the message of a change, for clients.
pub(crate) fn overlay_change_to_pb(change: &OverlayChange) -> (Vec<String>, proto::Overlay) {
    let (mut paths, trajectories) = change_to_pb(&change.trajectories, "overlay.trajectories", trajectory_to_pb);
    let (label_paths, labels) = change_to_pb(&change.labels, "overlay.labels", label_to_pb);
    paths.extend(label_paths);
    let (picture_paths, pictures) = change_to_pb(&change.pictures, "overlay.pictures", picture_change_to_pb);
    paths.extend(picture_paths);
    paths.extend(change.grids.is_some().then(|| "overlay.grids".to_owned()));
    paths.extend(change.cardinal_points.is_some().then(|| "overlay.cardinal_points".to_owned()));
    paths.extend(change.test_patterns.is_some().then(|| "overlay.test_patterns".to_owned()));
    let grids = change.grids.iter().flatten().map(grid_to_pb).collect();
    let test_patterns = change.test_patterns.clone().unwrap_or_default();
    let cardinal_points = change.cardinal_points.unwrap_or_default();
    (paths, proto::Overlay { grids, trajectories, labels, test_patterns, cardinal_points, pictures })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn style() -> LineStyle {
        LineStyle { colour: Colour([1, 2, 255]), width_px: 3.5, opacity: 0.25 }
    }

    fn overlay() -> Overlay {
        let anchors =
            [Anchor::Direction(DVec3::Y), Anchor::Point(DVec3::new(1.0, -2.0, 3e11)), Anchor::Horizon([0.25, -0.5])];
        let label = |(index, anchor): (usize, Anchor)| Label {
            name: format!("l{index}"),
            text: "α Cen".to_owned(),
            anchor,
            colour: Colour([9, 8, 7]),
            size_px: 20.0,
            opacity: 0.5,
        };
        Overlay {
            pictures: Vec::new(),
            grids: GridKind::ALL
                .map(|kind| {
                    let divisions = if kind == GridKind::Constellations { 6 } else { 7 };
                    Grid { numbers: false, ..Grid::new(kind, divisions, style()) }
                })
                .to_vec(),
            trajectories: vec![Trajectory::new("way", vec![DVec3::X, DVec3::Y], style())],
            labels: anchors.into_iter().enumerate().map(label).collect(),
            cardinal_points: true,
            test_patterns: vec!["dome".to_owned()],
        }
    }

    #[test]
    fn overlays_survive_a_round_trip() {
        assert_eq!(overlay_from_pb(overlay_to_pb(&overlay())), Ok(overlay()));
        let change = OverlayChange::all(overlay());
        let (paths, message) = overlay_change_to_pb(&change);
        let mut back = OverlayChange::default();
        for path in &paths {
            assert!(add_overlay_change(&mut back, path.strip_prefix("overlay").unwrap(), Some(&message)).unwrap());
        }
        assert_eq!(back, change);
        let mut whole = OverlayChange::default();
        assert!(add_overlay_change(&mut whole, "", Some(&message)).unwrap());
        assert_eq!(whole, change);
    }

    #[test]
    fn missing_values_are_the_defaults_of_configurations() {
        let bare = proto::Overlay {
            grids: vec![proto::Grid { kind: "galactic".to_owned(), ..Default::default() }],
            labels: vec![proto::Label {
                name: "here".to_owned(),
                anchor: Some(proto::label::Anchor::Direction(proto::Vector3 { x: 0.0, y: 0.0, z: 2.0 })),
                ..Default::default()
            }],
            ..Default::default()
        };
        let overlay = overlay_from_pb(bare).unwrap();
        assert_eq!(overlay.grids, [Grid::new(GridKind::Galactic, 6, Grid::STYLE)]);
        let label = &overlay.labels[0];
        assert_eq!((label.text.as_str(), label.anchor), ("here", Anchor::Direction(DVec3::Z)));
        assert_eq!((label.colour, label.size_px, label.opacity), (Label::COLOUR, Label::SIZE_PX, 1.0));
    }
}
