//! Pictures of one asteroid through a flat window: from its mesh, and from the impostor of a method.

use glam::{DMat3, DVec2, DVec3};

use super::{
    bake::{Atlas, Texel},
    raster::{Projected, hits},
};
use crate::{
    plan::asteroids::{
        ImpostorMethod,
        tiles::{AtlasLayout, AtlasTile, TileAxes, euler, shown_view_from_shape, tiles_shown},
    },
    scene::asteroids::Mesh,
};

/// View of an asteroid: a square window of the image plane z = -1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Rotation from the shape's axes to those of the view.
    pub view_from_shape: DMat3,
    /// The asteroid's centre, view axes, mean radii from the eye.
    pub centre: DVec3,
    /// Centre of the window, tangents to the right and up.
    pub middle: DVec2,
    /// Half of its side, tangents.
    pub half_width: f64,
    /// Pixels along its side.
    pub side: usize,
    /// Samples along the side of a pixel.
    pub samples: usize,
}

/// The picture in a window, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Covered fraction of each pixel.
    pub coverage: Vec<f64>,
    /// Sum of the unit normals of its covered samples, view axes.
    pub normals: Vec<DVec3>,
}

impl Sight {
    /// Creates a window with pixels of `pixel_rad` around an asteroid with this bounding radius.
    pub fn around(view_from_shape: DMat3, centre: DVec3, bound: f64, pixel_rad: f64, samples: usize) -> Self {
        let middle = centre.truncate() / -centre.z;
        // Away from the axis, a sphere's image is longer by the inverse square of the cosine.
        let reach = 1.1 * bound / centre.length() * (1.0 + middle.length_squared());
        let side = (2.0 * reach / pixel_rad).ceil() as usize + 2;
        Self { view_from_shape, centre, middle, half_width: 0.5 * side as f64 * pixel_rad, side, samples }
    }

    /// Builds a picture from a function that returns the visible unit normal, view axes, of each sample, or nothing.
    fn picture(&self, seen: impl Fn(usize, usize) -> Option<DVec3>) -> Picture {
        let share = 1.0 / (self.samples * self.samples) as f64;
        let pixels = self.side * self.side;
        let mut picture = Picture { coverage: vec![0.0; pixels], normals: vec![DVec3::ZERO; pixels] };
        for j in 0..self.side * self.samples {
            for i in 0..self.side * self.samples {
                if let Some(normal) = seen(i, j) {
                    let pixel = j / self.samples * self.side + i / self.samples;
                    picture.coverage[pixel] += share;
                    picture.normals[pixel] += normal;
                }
            }
        }
        picture
    }

    /// Samples per tangent.
    fn scale(&self) -> f64 {
        0.5 * (self.side * self.samples) as f64 / self.half_width
    }

    /// Returns the unit vector of the viewing direction of a sample.
    fn ray(&self, i: usize, j: usize) -> DVec3 {
        let scale = self.scale();
        let place = DVec2::new(i as f64 + 0.5, j as f64 + 0.5) / scale - self.half_width;
        DVec3::new(self.middle.x + place.x, self.middle.y - place.y, -1.0).normalize()
    }
}

/// Returns the picture of a mesh.
pub fn mesh_picture(mesh: &Mesh, sight: &Sight) -> Picture {
    let side = sight.side * sight.samples;
    let found = hits(mesh, side, |position| {
        let point = sight.centre + sight.view_from_shape * position;
        let place = point.truncate() / -point.z - sight.middle;
        let weight = -1.0 / point.z;
        Projected {
            place: DVec2::new(place.x + sight.half_width, sight.half_width - place.y) * sight.scale(),
            nearness: weight,
            weight,
        }
    });
    sight.picture(|i, j| found[j * side + i].map(|hit| sight.view_from_shape * hit.normal))
}

/// Returns the picture that a method draws from an atlas; `None` if the method draws none, or the atlas has another layout.
pub fn impostor_picture(method: ImpostorMethod, atlas: &Atlas, sight: &Sight) -> Option<Picture> {
    if AtlasLayout::for_method(method) != Some(atlas.layout()) {
        return None;
    }
    let square = Square::new(method, atlas, sight)?;
    Some(sight.picture(|i, j| {
        let texel = square.texel(sight.ray(i, j));
        (texel.coverage >= 0.5).then(|| (sight.view_from_shape * texel.normal).normalize_or_zero())
    }))
}

/// The square that shows an impostor, for intersection with rays.
struct Square<'a> {
    atlas: &'a Atlas,
    sight: &'a Sight,
    blends: bool,
    /// Unit normal of the square.
    across: DVec3,
    /// Radius of the asteroid's outline on the square.
    outline: f64,
    tiles: Vec<(AtlasTile, TileAxes, f64)>,
    /// Rotation from the shape's axes to view axes, as displayed by the first tile.
    displayed: DMat3,
    /// The rotation of the square in the image plane.
    roll: DMat3,
}

impl<'a> Square<'a> {
    fn new(method: ImpostorMethod, atlas: &'a Atlas, sight: &'a Sight) -> Option<Self> {
        let distance = sight.centre.length();
        let to_eye = -sight.centre / distance;
        let displayed = tiles_shown(method, sight.view_from_shape, to_eye, atlas.tiles())?;
        let tiles: Vec<_> = displayed
            .into_iter()
            .filter(|(_, weight)| *weight > 0.0)
            .map(|(tile, weight)| (tile, atlas.layout().axes(tile, atlas.tiles()), weight))
            .collect();
        let published = method.chosen() == ImpostorMethod::EulerAtlas;
        let bound = atlas.bound();
        Some(Self {
            atlas,
            sight,
            blends: matches!(method.chosen(), ImpostorMethod::OctahedralBlend | ImpostorMethod::OctahedralSplat),
            across: if published { DVec3::Z } else { to_eye },
            outline: if published { bound } else { bound * distance / (distance * distance - bound * bound).sqrt() },
            displayed: shown_view_from_shape(method, tiles[0].0, sight.view_from_shape, to_eye, atlas.tiles())?,
            roll: DMat3::from_rotation_z(euler::Angles::from_rotation(sight.view_from_shape).roll_rad),
            tiles,
        })
    }

    fn texel(&self, ray: DVec3) -> Texel {
        let offset = ray * (self.sight.centre.dot(self.across) / ray.dot(self.across)) - self.sight.centre;
        let (tile, axes, _) = self.tiles[0];
        if self.blends {
            return self.blended(offset, ray);
        }
        let place = if self.atlas.layout() == AtlasLayout::Euler {
            (self.roll.transpose() * offset).truncate()
        } else {
            DVec2::new(offset.dot(self.displayed * axes.right), offset.dot(self.displayed * axes.up))
        };
        self.atlas.sample(tile, place / self.outline)
    }

    /// Blends three tiles. Each is sampled where the ray meets the depth stored in it.
    fn blended(&self, offset: DVec3, ray: DVec3) -> Texel {
        let shape_from_view = self.sight.view_from_shape.transpose();
        let start = shape_from_view * offset / self.atlas.bound();
        let along = shape_from_view * ray;
        let mut sum = Texel::default();
        let mut inner = 0.0;
        for (tile, axes, weight) in &self.tiles {
            let mut texel = Texel::default();
            for _ in 0..PARALLAX_STEPS {
                let step = (texel.depth - start.dot(axes.direction)) / along.dot(axes.direction);
                let point = start + step * along;
                texel = self.atlas.sample(*tile, DVec2::new(point.dot(axes.right), point.dot(axes.up)));
            }
            sum.coverage += weight * texel.coverage;
            inner += weight * texel.coverage;
            sum.normal += weight * texel.coverage * texel.normal;
            sum.albedo += weight * texel.coverage * texel.albedo;
        }
        if inner > 0.0 {
            sum.normal /= inner;
            sum.albedo /= inner;
        }
        sum
    }
}

/// Number of iterations that find the position on a tile from the depth at the previous position; the first uses depth
/// 0.
const PARALLAX_STEPS: usize = 3;

/// Returns the area covered by both pictures divided by the area covered by either.
pub fn silhouette_iou(a: &Picture, b: &Picture) -> f64 {
    let pairs = || a.coverage.iter().zip(&b.coverage);
    let both: f64 = pairs().map(|(a, b)| a.min(*b)).sum();
    let either: f64 = pairs().map(|(a, b)| a.max(*b)).sum();
    if either > 0.0 { both / either } else { 1.0 }
}

/// Returns the mean angle between the normals of two pictures over the pixels that both cover, weighted by the common coverage, rad.
pub fn normal_error_rad(a: &Picture, b: &Picture) -> f64 {
    let (mut sum, mut area) = (0.0, 0.0);
    for index in 0..a.coverage.len() {
        let both = a.coverage[index].min(b.coverage[index]);
        let (a, b) = (a.normals[index], b.normals[index]);
        if both > 0.0 && a != DVec3::ZERO && b != DVec3::ZERO {
            sum += both * a.cross(b).length().atan2(a.dot(b));
            area += both;
        }
    }
    if area > 0.0 { sum / area } else { 0.0 }
}
