//! The twin of the overlay pass: it iterates over the items of a plan instead of over pixels, and does not use blocks.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use crate::{
    photometry::tone_map::{linear_from_srgb, srgb_from_linear},
    plan::overlay::{BEFORE_ALL, Item, Shape},
    view::projection::pixel_centre,
};

/// Coverage of a pixel by bodies and asteroids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cover {
    /// Covered fraction, 0 to 1.
    pub share: f64,
    /// Distance of the nearest covering object, m.
    pub distance_m: f64,
}

/// An image that items are drawn onto.
pub struct OverlayTarget<'a> {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Red, green, blue and alpha of each pixel, row by row from the top: sRGB codes.
    pub codes: &'a mut [u8],
    /// Whether a pixel belongs to the picture. Nothing is drawn outside of a round picture.
    pub contains: &'a dyn Fn(u32, u32) -> bool,
    /// Direction of the centre of a pixel, view axes; `None` outside of the picture.
    pub direction: &'a dyn Fn(u32, u32) -> Option<DVec3>,
    /// Objects in front of a pixel.
    pub cover: &'a dyn Fn(u32, u32) -> Option<Cover>,
}

/// Returns the fraction of a pixel covered by a line with round ends: `half_width_px + 0.5` minus the distance of the pixel's centre.
pub fn line_coverage(centre: DVec2, from: DVec2, to: DVec2, half_width_px: f64) -> f64 {
    let along = to - from;
    let length_squared = along.length_squared();
    let part = if length_squared > 0.0 { ((centre - from).dot(along) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (half_width_px + 0.5 - centre.distance(from + along * part)).clamp(0.0, 1.0)
}

/// Returns the pixels that a shape may cover: first column and row, and those after the last.
fn bounds(shape: &Shape, size: [u32; 2]) -> [[u32; 2]; 2] {
    let (least, most) = match *shape {
        Shape::Line { from, to, half_width_px, .. } => {
            let reach = DVec2::splat(half_width_px + 1.0);
            (from.min(to) - reach, from.max(to) + reach)
        }
        Shape::Box { from, to, .. } | Shape::Picture { from, to, .. } => {
            (DVec2::from_array(from.map(f64::from)), DVec2::from_array(to.map(f64::from)))
        }
        Shape::Glyph { from, size, .. } => {
            let first = DVec2::from_array(from.map(f64::from));
            (first, first + DVec2::from_array(size.map(f64::from)))
        }
    };
    let held = |value: f64, side: u32| value.clamp(0.0, f64::from(side)) as u32;
    [
        [held(least.x.floor(), size[0]), held(least.y.floor(), size[1])],
        [held(most.x.ceil(), size[0]), held(most.y.ceil(), size[1])],
    ]
}

/// Returns the coverage of a pixel by a shape, and the inverse of the distance of the covering point.
fn coverage(shape: &Shape, texels: &[u8], x: u32, y: u32) -> (f64, f64) {
    match *shape {
        Shape::Line { from, to, half_width_px, nearness } => {
            let centre = pixel_centre(x, y);
            let along = to - from;
            let part = ((centre - from).dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
            let near =
                if nearness[0] == BEFORE_ALL { BEFORE_ALL } else { nearness[0] + (nearness[1] - nearness[0]) * part };
            (line_coverage(centre, from, to, half_width_px), near)
        }
        Shape::Box { checkered, .. } => (if checkered && (x + y) % 2 == 1 { 0.0 } else { 1.0 }, BEFORE_ALL),
        Shape::Glyph { from, size, first_texel, nearness } => {
            let [column, row] = [x as i32 - from[0], y as i32 - from[1]].map(|offset| offset as u32);
            let texel = texels[(first_texel + row * size[0] + column) as usize];
            (f64::from(texel) / 255.0, nearness)
        }
        // The alpha of the picture's texels determines its share.
        Shape::Picture { nearness, .. } => (1.0, nearness),
    }
}

/// Returns the linear light and alpha of a picture in a direction, view axes.
fn picture_in(texels: &[u8], header: u32, direction: DVec3) -> Option<([f64; 3], f64)> {
    let word = |index: u32| -> [u8; 4] { std::array::from_fn(|byte| texels[4 * index as usize + byte]) };
    let number = |index: u32| f64::from(f32::from_le_bytes(word(header + index)));
    let [x, y, ahead] = [0, 3, 6].map(|row| DVec3::new(number(row), number(row + 1), number(row + 2)).dot(direction));
    if ahead <= 0.0 {
        return None;
    }
    let [width, height, first] = [11, 12, 13].map(|index| u32::from_le_bytes(word(header + index)));
    let [column, row] = [(x / ahead + 0.5) * number(9) - 0.5, (y / ahead + 0.5) * number(10) - 0.5];
    let (mut light, mut alpha) = ([0.0; 3], 0.0);
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let [at_x, at_y] = [column.floor() + dx, row.floor() + dy];
        let inside = (0.0..f64::from(width)).contains(&at_x) && (0.0..f64::from(height)).contains(&at_y);
        if !inside {
            continue;
        }
        let [red, green, blue, opaque] = word(first + at_y as u32 * width + at_x as u32);
        let weight = (1.0 - (column - at_x).abs()) * (1.0 - (row - at_y).abs()) * f64::from(opaque) / 255.0;
        alpha += weight;
        for (sum, part) in light.iter_mut().zip(light_of([red, green, blue])) {
            *sum += weight * part;
        }
    }
    (alpha > 0.0).then(|| (light.map(|sum| sum / alpha), alpha))
}

/// Draws items in order.
pub fn draw(target: &mut OverlayTarget<'_>, items: &[Item], texels: &[u8]) {
    // Linear light of the touched pixels. It is rounded only once, at the end.
    let mut lights: BTreeMap<(u32, u32), [f64; 3]> = BTreeMap::new();
    let [width, _] = target.size;
    let index_of = |(x, y): (u32, u32)| 4 * (y as usize * width as usize + x as usize);
    let mut rest = items;
    while let Some(first) = rest.first() {
        let count = rest.iter().take_while(|item| item.stroke == first.stroke).count();
        let (stroke, after) = rest.split_at(count);
        // The largest coverage of the stroke at each pixel that it touches.
        let mut covered: BTreeMap<(u32, u32), (f64, [f64; 3])> = BTreeMap::new();
        for item in stroke {
            let [[left, top], [right, bottom]] = bounds(&item.shape, target.size);
            for y in top..bottom {
                for x in left..right {
                    let (mut share, nearness) = coverage(&item.shape, texels, x, y);
                    let mut light = light_of(item.ink.colour.0);
                    if let Shape::Picture { header, .. } = item.shape {
                        let seen = (target.direction)(x, y).and_then(|towards| picture_in(texels, header, towards));
                        (light, share) = seen.unwrap_or_default();
                    }
                    if let Some(cover) = (target.cover)(x, y).filter(|cover| cover.distance_m * nearness < 1.0) {
                        share *= 1.0 - cover.share;
                    }
                    if share > 0.0 && (target.contains)(x, y) {
                        let most = covered.entry((x, y)).or_insert((0.0, light));
                        *most = if share > most.0 { (share, light) } else { *most };
                    }
                }
            }
        }
        for (pixel, (share, ink)) in covered {
            let index = index_of(pixel);
            let codes = [0, 1, 2].map(|channel| target.codes[index + channel]);
            mix(lights.entry(pixel).or_insert(light_of(codes)), ink, share * first.ink.opacity);
        }
        rest = after;
    }
    for (pixel, light) in lights {
        let index = index_of(pixel);
        for (channel, value) in light.into_iter().enumerate() {
            target.codes[index + channel] = (srgb_from_linear(value) * 255.0).round() as u8;
        }
    }
}

fn light_of(codes: [u8; 3]) -> [f64; 3] {
    codes.map(|code| linear_from_srgb(f64::from(code) / 255.0))
}

/// Mixes a share of other light into the light of a pixel.
fn mix(light: &mut [f64; 3], ink: [f64; 3], share: f64) {
    for (below, above) in light.iter_mut().zip(ink) {
        *below += (above - *below) * share;
    }
}
