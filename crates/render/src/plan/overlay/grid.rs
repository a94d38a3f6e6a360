//! Grids of longitude and latitude.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DMat3, DVec3};

use super::{
    AT_INFINITY, Drawing, Eye, Ink, OverlayPlanError,
    arc::Arc,
    ground_altitude_rad,
    text::{Place, Run},
};
use crate::{
    catalogue::constellations::{Border, borders, icrs_from_b1875, middles},
    coordinates::icrs_from_galactic,
    ephemeris::icrs_from_ecliptic,
    scene::{
        SceneObjects,
        overlay::{Grid, GridKind},
    },
};

/// Height of the numbers, pixels.
const NUMBER_PX: f64 = 13.0;

/// Directions of longitude 0, of longitude 90 degrees and of the pole: apparent directions in view axes (see `Eye::seen`), except for the
/// camera's own axes, which motion does not change.
fn axes(kind: GridKind, eye: &Eye<'_>) -> DMat3 {
    match kind {
        GridKind::Equatorial => DMat3::IDENTITY,
        GridKind::Galactic => icrs_from_galactic(),
        GridKind::Ecliptic => icrs_from_ecliptic(),
        GridKind::Constellations => icrs_from_b1875(),
        // Without an observer there is no such grid: see `Overlay::check_observer`.
        GridKind::Horizon => eye.horizon.unwrap_or(DMat3::IDENTITY),
        GridKind::Altitude => {
            let turn = eye.camera.world_from_camera;
            DMat3::from_cols(turn * DVec3::NEG_Z, turn * DVec3::X, turn * DVec3::Y)
        }
    }
}

fn direction(axes: &DMat3, longitude: f64, latitude: f64) -> DVec3 {
    *axes * crate::coordinates::direction_from_lon_lat(longitude, latitude)
}

pub(super) fn draw(drawing: &mut Drawing<'_>, eye: &Eye<'_>, grid: &Grid) -> Result<(), OverlayPlanError> {
    let axes = axes(grid.kind, eye);
    if grid.kind == GridKind::Constellations {
        return drawing.lines(eye, &grid.style(), borders().iter().map(|border| border_arc(&axes, border)), true);
    }
    let step = FRAC_PI_2 / f64::from(grid.divisions());
    let divisions = i64::from(grid.divisions());
    let parallels = (1 - divisions..divisions).map(|number| {
        let from_pole = FRAC_PI_2 - number as f64 * step;
        Arc::circle(axes.z_axis, axes.x_axis, axes.y_axis, from_pole)
    });
    // Only every fourth meridian continues to the poles: there, all meridians would be too dense.
    let meridians = (0..4 * divisions).map(|number| {
        let reach = if number % divisions == 0 { FRAC_PI_2 } else { FRAC_PI_2 - step };
        Arc::half_circle(direction(&axes, number as f64 * step, 0.0), axes.z_axis, reach)
    });
    let arcs = parallels.chain(meridians);
    let own_axes = grid.kind == GridKind::Altitude;
    if own_axes {
        let turned = arcs.map(|arc| arc.turned(&eye.view_from_world));
        drawing.view_lines(eye, &grid.style(), turned)?;
    } else {
        // Altitudes are apparent.
        drawing.lines(eye, &grid.style(), arcs, grid.kind != GridKind::Horizon)?;
    }
    Ok(())
}

/// A piece of a border as an arc.
fn border_arc(axes: &DMat3, Border { ra_rad: [from, to], dec_rad: [south, north], .. }: &Border) -> Arc {
    if from == to {
        let middle = 0.5 * (south + north);
        let [at, above] = [middle, middle + FRAC_PI_2].map(|latitude| direction(axes, *from, latitude));
        return Arc::half_circle(at, above, 0.5 * (north - south));
    }
    let mut circle = Arc::circle(axes.z_axis, axes.x_axis, axes.y_axis, FRAC_PI_2 - south);
    circle.angles = [*from, *to];
    circle
}

/// Draws the numbers of the circles.
pub(super) fn draw_numbers(
    drawing: &mut Drawing<'_>,
    eye: &Eye<'_>,
    grid: &Grid,
    objects: &SceneObjects,
) -> Result<(), OverlayPlanError> {
    if !grid.numbers {
        return Ok(());
    }
    let axes = axes(grid.kind, eye);
    let step = FRAC_PI_2 / f64::from(grid.divisions());
    let divisions = i64::from(grid.divisions());
    let ink = Ink { colour: grid.colour, opacity: grid.opacity };
    let mut number = |text: &str, direction: DVec3| {
        let direction = match grid.kind {
            GridKind::Altitude => eye.view_from_world * direction,
            GridKind::Horizon => eye.apparent_without_air(direction),
            _ => eye.apparent(direction),
        };
        let place = Place::Beside { gap_px: grid.width_px / 2.0 + 2.0 };
        drawing.text_at(
            eye,
            direction,
            &Run { text, size_px: NUMBER_PX, ink, nearness: AT_INFINITY, place, edged: true },
        )
    };
    if grid.kind == GridKind::Constellations {
        return middles().iter().try_for_each(|(name, middle)| number(name, *middle));
    }
    // Longitudes along the equator, latitudes along four meridians.
    for index in 0..4 * divisions {
        let longitude = index as f64 * step;
        // Azimuths are written where the ground does not hide them.
        let ground = if grid.kind == GridKind::Horizon { ground_altitude_rad(objects, longitude) } else { 0.0 };
        number(&longitude_text(grid.kind, longitude), direction(&axes, longitude, ground))?;
    }
    for quarter in 0..4 {
        for index in (1 - divisions..divisions).filter(|index| *index != 0) {
            let latitude = index as f64 * step;
            let text = format!("{}{}°", if index > 0 { "+" } else { "-" }, trimmed(latitude.abs().to_degrees()));
            number(&text, direction(&axes, f64::from(quarter) * FRAC_PI_2, latitude))?;
        }
    }
    Ok(())
}

/// With at most three decimals, without trailing zeros.
fn trimmed(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Hours and minutes of right ascension, otherwise degrees.
fn longitude_text(kind: GridKind, longitude: f64) -> String {
    if kind != GridKind::Equatorial {
        return format!("{}°", trimmed(longitude.to_degrees()));
    }
    let minutes = longitude / TAU * 24.0 * 60.0;
    let hours = (minutes / 60.0 + 1e-9).floor();
    let rest = minutes - hours * 60.0;
    if rest.abs() < 1e-3 { format!("{hours}h") } else { format!("{hours}h{}m", trimmed(rest)) }
}
