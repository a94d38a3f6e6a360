//! The test pattern of an image, for aligning and assessing projectors.
//!
//! In the picture's geometry: circles every 10 degrees around the axis of the view, and a cross through it. For a projector: circles around the apex
//! of the dome, and twelve rays from the apex; both continue from projector to projector. In pixels, for any projection: a frame of the outermost
//! pixels, lines every [`GRID_PX`] pixels, patches of single pixels, bars of colours and of greys, and the name.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{
    BEFORE_ALL, Drawing, Eye, Ink, OverlayPlanError, Shape,
    arc::Arc,
    text::{Place, Run},
};
use crate::{
    scene::overlay::{Colour, LineStyle},
    view::projection::Projection,
};

/// Spacing of the pixel grid, pixels.
pub const GRID_PX: u32 = 64;

const WHITE: Colour = Colour([255; 3]);
const LINES: LineStyle = LineStyle { colour: Colour([96, 96, 96]), width_px: 1.0, opacity: 1.0 };
const CIRCLES: LineStyle = LineStyle { colour: Colour([0, 200, 120]), width_px: 1.5, opacity: 1.0 };
const CROSS: LineStyle = LineStyle { colour: Colour([255, 96, 64]), width_px: 1.5, opacity: 1.0 };

/// White, yellow, cyan, green, magenta, red, blue, black, as on television.
const BARS: [Colour; 8] = [
    WHITE,
    Colour([255, 255, 0]),
    Colour([0, 255, 255]),
    Colour([0, 255, 0]),
    Colour([255, 0, 255]),
    Colour([255, 0, 0]),
    Colour([0, 0, 255]),
    Colour([0; 3]),
];
/// Number of grey levels, including black and white.
const GREYS: usize = 11;

fn opaque(colour: Colour) -> Ink {
    Ink { colour, opacity: 1.0 }
}

pub(super) fn draw(drawing: &mut Drawing<'_>, eye: &Eye<'_>, name: &str) -> Result<(), OverlayPlanError> {
    pixel_grid(drawing, eye.viewport.size())?;
    let centre = Centre::new(eye);
    let [u, v] = centre.across;
    let circles = (1..18).map(|tens| Arc::circle(centre.axis, u, v, f64::from(tens) * PI / 18.0).before_all());
    drawing.view_lines(eye, &CIRCLES, circles)?;
    // Great circles through the axis, drawn to both sides of it.
    let cross = (0..centre.rays / 2).map(|ray| Arc::half_circle(centre.axis, centre.towards(ray), PI).before_all());
    drawing.view_lines(eye, &CROSS, cross)?;
    numbers(drawing, eye, &centre)?;
    patches(drawing, eye.viewport.size())?;
    names(drawing, eye, name)?;
    frame(drawing, eye.viewport.size())
}

/// Axis of the circles.
struct Centre {
    axis: DVec3,
    /// Orthogonal to it and to each other.
    across: [DVec3; 2],
    rays: u32,
}

impl Centre {
    fn new(eye: &Eye<'_>) -> Self {
        match &eye.viewport.projection {
            // The axes of a projector's view are those of the dome.
            Projection::Tabulated(_) => Self { axis: DVec3::Y, across: [DVec3::NEG_Z, DVec3::X], rays: 12 },
            _ => Self { axis: DVec3::NEG_Z, across: [DVec3::X, DVec3::Y], rays: 4 },
        }
    }

    /// Unit vector at an angle from the axis along a ray.
    fn towards(&self, ray: u32) -> DVec3 {
        let (sin, cos) = (f64::from(ray) * 2.0 * PI / f64::from(self.rays)).sin_cos();
        self.across[0] * cos + self.across[1] * sin
    }
}

fn boxed(drawing: &mut Drawing<'_>, ink: Ink, [x0, y0]: [i32; 2], [x1, y1]: [i32; 2]) -> Result<(), OverlayPlanError> {
    drawing.push(ink, Shape::Box { from: [x0, y0], to: [x1, y1], checkered: false })
}

fn pixel_grid(drawing: &mut Drawing<'_>, size: [u32; 2]) -> Result<(), OverlayPlanError> {
    let [width, height] = size.map(|side| side as i32);
    drawing.next_stroke();
    // Start at the centre, so that the grid is symmetric.
    let lines = |side: i32| (side / 2 % GRID_PX as i32..side).step_by(GRID_PX as usize);
    for x in lines(width) {
        boxed(drawing, opaque(LINES.colour), [x, 0], [x + 1, height])?;
    }
    for y in lines(height) {
        boxed(drawing, opaque(LINES.colour), [0, y], [width, y + 1])?;
    }
    Ok(())
}

/// Draw the outermost pixels over everything else: they show whether the whole picture is visible.
fn frame(drawing: &mut Drawing<'_>, size: [u32; 2]) -> Result<(), OverlayPlanError> {
    let [width, height] = size.map(|side| side as i32);
    drawing.next_stroke();
    for (from, to) in [
        ([0, 0], [width, 1]),
        ([0, height - 1], [width, height]),
        ([0, 0], [1, height]),
        ([width - 1, 0], [width, height]),
    ] {
        boxed(drawing, opaque(WHITE), from, to)?;
    }
    Ok(())
}

/// Bars below the centre, and patches of single pixels above it.
fn patches(drawing: &mut Drawing<'_>, size: [u32; 2]) -> Result<(), OverlayPlanError> {
    let [width, height] = size.map(f64::from);
    let position = |x: f64, y: f64| [(x * width).round() as i32, (y * height).round() as i32];
    let mut band = |count: usize, [top, bottom]: [f64; 2], colour: &dyn Fn(usize) -> Colour| {
        for index in 0..count {
            let [left, right] = [index, index + 1].map(|step| 0.25 + 0.5 * step as f64 / count as f64);
            drawing.next_stroke();
            boxed(drawing, opaque(colour(index)), position(left, top), position(right, bottom))?;
        }
        Ok(())
    };
    band(BARS.len(), [0.66, 0.72], &|index| BARS[index])?;
    band(GREYS, [0.72, 0.76], &|index| Colour([(255 * index / (GREYS - 1)) as u8; 3]))?;
    let side = (width.min(height) / 24.0).round().clamp(2.0, 32.0) as i32;
    for x in [0.3, 0.7] {
        let [x, y] = position(x, 0.36);
        let (from, to) = ([x - side / 2, y - side / 2], [x - side / 2 + side, y - side / 2 + side]);
        drawing.next_stroke();
        boxed(drawing, opaque(Colour([0; 3])), from, to)?;
        drawing.next_stroke();
        drawing.push(opaque(WHITE), Shape::Box { from, to, checkered: true })?;
    }
    Ok(())
}

/// Degrees next to the circles, along the cross, if there is space for them.
fn numbers(drawing: &mut Drawing<'_>, eye: &Eye<'_>, centre: &Centre) -> Result<(), OverlayPlanError> {
    let size_px = 13.0;
    let mapping = eye.viewport.projection.mapping();
    for toward in (0..centre.rays).map(|ray| centre.towards(ray)) {
        let mut last = mapping.pixel_from_direction(centre.axis);
        for tens in 1..18 {
            let (sin, cos) = (f64::from(tens) * PI / 18.0).sin_cos();
            // A projector's raster may begin anywhere along the ray.
            let Some(pixel) = mapping.pixel_from_direction(centre.axis * cos + toward * sin) else { continue };
            if last.is_some_and(|last: DVec2| last.distance(pixel) < 3.0 * size_px) {
                continue;
            }
            last = Some(pixel);
            let text = format!("{}°", 10 * tens);
            let place = Place::Beside { gap_px: 3.0 };
            drawing.text(
                eye,
                pixel,
                0.0,
                &Run { text: &text, size_px, ink: opaque(CIRCLES.colour), nearness: BEFORE_ALL, place, edged: true },
            )?;
        }
    }
    Ok(())
}

fn names(drawing: &mut Drawing<'_>, eye: &Eye<'_>, name: &str) -> Result<(), OverlayPlanError> {
    let [width, height] = eye.viewport.size();
    let name = match eye.viewport.part.name() {
        Some(part) => format!("{name} {part}"),
        None => name.to_owned(),
    };
    let middle = |y: f64| DVec2::new(f64::from(width) / 2.0, f64::from(height) * y);
    let size_px = (f64::from(width.min(height)) / 16.0).clamp(10.0, 64.0);
    for (text, size_px, y) in [
        (name, size_px, 0.25),
        (format!("{width} x {height}"), size_px / 2.0, 0.25 + 1.1 * size_px / f64::from(height)),
    ] {
        let run =
            Run { text: &text, size_px, ink: opaque(WHITE), nearness: BEFORE_ALL, place: Place::Centred, edged: false };
        // Draw the name on a plate, so that it is readable over the lines.
        let half = [super::text::width_px(&text, size_px) / 2.0 + size_px / 3.0, size_px * 0.6];
        let anchor = middle(y);
        let corner =
            |side: f64| [(anchor.x + side * half[0]).round() as i32, (anchor.y + side * half[1]).round() as i32];
        drawing.next_stroke();
        boxed(drawing, opaque(Colour([0; 3])), corner(-1.0), corner(1.0))?;
        drawing.text(eye, anchor, 0.0, &run)?;
    }
    Ok(())
}
