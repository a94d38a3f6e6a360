//! Ground truth of asteroid fields: traces the rays of every pixel against the meshes themselves, in f64, in any
//! projection.
//!
//! A pixel is divided into n x n squares of the image plane, and a ray goes through the centre of each, from the exact
//! f64 position of the eye. It is intersected with the meshes of one level of detail: flat triangles, with normals and
//! albedo interpolated between the vertices as on the GPU. There are no shadows between asteroids and no second
//! reflections; the eye is at rest.
//!
//! The instances that a pixel may show are found by testing its cone against the tree of each field. This is first done for tiles of pixels.

use std::f64::consts::PI;

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use crate::{
    reference::stars::splat::Eye,
    scene::asteroids::{AsteroidField, Mesh, MeshTree},
    view::projection::PlaneMapping,
};

/// Pixels along a side of the tiles that share a list of instances.
const TILE: u32 = 8;

/// Returns the luminance of a surface under an illuminance of 1 lx, cd/m^2. The arguments are the albedo factor at the point, and the cosines of the
/// angles between the normal and the directions to the light and to the eye. Both cosines are above 0.
pub type Shade<'a> = &'a (dyn Fn(f64, f64, f64) -> f64 + Sync);

/// A field at a moment, lit by a sun.
#[derive(Clone, Copy)]
pub struct LitField<'a> {
    /// The field.
    pub field: &'a AsteroidField,
    /// Time, s.
    pub time_s: f64,
    /// Unit vector to the sun, world axes.
    pub towards_sun: DVec3,
    /// Illuminance of a surface facing the sun, lx.
    pub illuminance_lx: f64,
    /// Its reflection function.
    pub shade: Shade<'a>,
}

/// Sampling of the rendering.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshSampling {
    /// Level of detail, 0 is the finest; a shape with fewer levels uses its coarsest.
    pub level: usize,
    /// Rays along each side of a pixel, at least 1.
    pub rays_per_side: u32,
}

/// Result for a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshPixel {
    /// Fraction of the pixel that asteroids cover, 0 to 1.
    pub coverage: f64,
    /// Mean luminance over the pixel, with a black background. It is in cd/m^2 if the shading function returns cd/m^2.
    pub luminance: f64,
    /// Mean of the visible normals, unit, world axes; 0 if there are none.
    pub normal: DVec3,
    /// Distance of the nearest hit, m; infinite if there is none.
    pub distance_m: f64,
}

impl MeshPixel {
    /// A pixel without asteroids.
    pub const EMPTY: Self = Self { coverage: 0.0, luminance: 0.0, normal: DVec3::ZERO, distance_m: f64::INFINITY };
}

/// A picture of meshes.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshImage {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Row by row from the top; empty outside of the picture.
    pub pixels: Vec<MeshPixel>,
}

/// A shape's mesh, ready for rays.
struct Model<'a> {
    mesh: &'a Mesh,
    tree: MeshTree,
    bound: f64,
}

/// A field relative to the eye.
struct FieldView<'a> {
    lit: LitField<'a>,
    models: Vec<Model<'a>>,
    /// Rotation from the field's axes to world axes.
    world_from_field: DMat3,
    /// The eye in the field's axes, m.
    eye_m: DVec3,
    time_parts: u32,
}

/// An instance that may be visible.
#[derive(Clone, Copy)]
struct Candidate {
    field: usize,
    instance: usize,
    /// Centre relative to the eye, world axes, m.
    middle_m: DVec3,
    /// Radius of its bounding sphere, m.
    bound_m: f64,
}

/// A cone from the eye, world axes.
#[derive(Clone, Copy)]
struct Cone {
    axis: DVec3,
    half_angle_rad: f64,
}

impl Cone {
    /// Returns the cone around directions, with a small margin.
    fn around(directions: &[DVec3]) -> Option<Self> {
        let sum: DVec3 = directions.iter().sum();
        let axis = sum.try_normalize().or(directions.first().copied())?;
        let widest = directions.iter().map(|direction| angle_rad(axis, *direction)).fold(0.0, f64::max);
        Some(Self { axis, half_angle_rad: widest * (1.0 + 1e-9) + 1e-12 })
    }

    /// Whether a sphere may intersect the cone.
    fn meets(&self, middle_m: DVec3, radius_m: f64) -> bool {
        let distance_m = middle_m.length();
        if distance_m <= radius_m {
            return true;
        }
        angle_rad(self.axis, middle_m) <= self.half_angle_rad + (radius_m / distance_m).asin()
    }
}

fn angle_rad(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Renders the meshes of fields as an eye sees them; its velocity is ignored.
pub fn render_meshes(
    mapping: &dyn PlaneMapping,
    eye: Eye,
    fields: &[LitField<'_>],
    sampling: MeshSampling,
) -> MeshImage {
    let seen: Vec<FieldView<'_>> = fields.iter().map(|lit| FieldView::new(*lit, eye, sampling.level)).collect();
    let size = mapping.size();
    let [width, height] = size;
    let world_from_view = DMat3::from_quat(eye.world_from_view);
    let rows: Vec<Vec<MeshPixel>> = (0..height.div_ceil(TILE))
        .into_par_iter()
        .flat_map_iter(|tile_row| {
            let from = tile_row * TILE;
            let mut rows = vec![vec![MeshPixel::EMPTY; width as usize]; (height - from).min(TILE) as usize];
            for tile in 0..width.div_ceil(TILE) {
                let columns = tile * TILE..(tile * TILE + TILE).min(width);
                let rays: Vec<Vec<DVec3>> = (0..rows.len() as u32)
                    .flat_map(|row| columns.clone().map(move |x| (x, from + row)))
                    .map(|pixel| rays_of(mapping, pixel, sampling.rays_per_side, world_from_view))
                    .collect();
                let Some(cone) = Cone::around(&rays.concat()) else { continue };
                let candidates: Vec<Candidate> =
                    seen.iter().enumerate().flat_map(|(number, field)| field.within(number, &cone)).collect();
                if candidates.is_empty() {
                    continue;
                }
                let mut rays = rays.iter();
                for row in &mut rows {
                    for (pixel, rays) in row[columns.start as usize..columns.end as usize].iter_mut().zip(&mut rays) {
                        *pixel = trace(&seen, &candidates, rays);
                    }
                }
            }
            rows
        })
        .collect();
    MeshImage { size, pixels: rows.concat() }
}

/// Returns the unit directions through the centres of a pixel's squares, world axes; none outside of the picture.
fn rays_of(mapping: &dyn PlaneMapping, (x, y): (u32, u32), per_side: u32, world_from_view: DMat3) -> Vec<DVec3> {
    if !mapping.contains(x, y) {
        return Vec::new();
    }
    let per_side = per_side.max(1);
    let inside = |k: u32| (f64::from(k) + 0.5) / f64::from(per_side);
    (0..per_side * per_side)
        .filter_map(|k| {
            let place = DVec2::new(f64::from(x) + inside(k % per_side), f64::from(y) + inside(k / per_side));
            mapping.direction_from_pixel(place).map(|direction| world_from_view * direction)
        })
        .collect()
}

/// Traces the rays of a pixel.
fn trace(seen: &[FieldView<'_>], candidates: &[Candidate], rays: &[DVec3]) -> MeshPixel {
    let Some(cone) = Cone::around(rays) else { return MeshPixel::EMPTY };
    let mut near: Vec<Candidate> = candidates.iter().filter(|c| cone.meets(c.middle_m, c.bound_m)).copied().collect();
    let front = |candidate: &Candidate| candidate.middle_m.length() - candidate.bound_m;
    near.sort_by(|a, b| front(a).total_cmp(&front(b)));
    let mut pixel = MeshPixel::EMPTY;
    for ray in rays {
        let mut nearest: Option<MeshPixel> = None;
        for candidate in &near {
            if nearest.as_ref().is_some_and(|met| front(candidate) > met.distance_m) {
                break;
            }
            if let Some(met) = seen[candidate.field].meet(candidate, *ray)
                && nearest.as_ref().is_none_or(|nearest| met.distance_m < nearest.distance_m)
            {
                nearest = Some(met);
            }
        }
        if let Some(met) = nearest {
            pixel.coverage += met.coverage;
            pixel.luminance += met.luminance;
            pixel.normal += met.normal;
            pixel.distance_m = pixel.distance_m.min(met.distance_m);
        }
    }
    let share = 1.0 / rays.len() as f64;
    MeshPixel {
        coverage: pixel.coverage * share,
        luminance: pixel.luminance * share,
        normal: pixel.normal.normalize_or_zero(),
        ..pixel
    }
}

impl<'a> FieldView<'a> {
    fn new(lit: LitField<'a>, eye: Eye, level: usize) -> Self {
        let field = lit.field;
        let model = |shape: &'a crate::scene::asteroids::Shape| {
            let lod = shape.lods.get(level).or(shape.lods.last())?;
            Some(Model { mesh: &lod.mesh, tree: MeshTree::new(&lod.mesh), bound: shape.bound })
        };
        let world_from_field = DMat3::from_quat(field.orientation);
        Self {
            lit,
            models: field.shapes.shapes.iter().filter_map(model).collect(),
            world_from_field,
            eye_m: world_from_field.transpose() * (eye.position_m - field.position_m),
            time_parts: field.instances.time_parts(lit.time_s),
        }
    }

    /// Returns the instances whose bounding spheres intersect a cone.
    fn within(&self, field: usize, cone: &Cone) -> Vec<Candidate> {
        let instances = &self.lit.field.instances;
        let cone = Cone { axis: self.world_from_field.transpose() * cone.axis, ..*cone };
        let mut found = Vec::new();
        let Some(top) = instances.levels.len().checked_sub(1) else { return found };
        let mut open: Vec<(usize, usize)> = (0..instances.levels[top].len()).map(|node| (top, node)).collect();
        while let Some((level, node)) = open.pop() {
            let node = &instances.levels[level][node];
            if !cone.meets(node.middle_m - self.eye_m, node.radius_m) {
                continue;
            }
            let below = node.first as usize..(node.first + node.count) as usize;
            if level > 0 {
                open.extend(below.map(|node| (level - 1, node)));
                continue;
            }
            // Subtract the eye from the middle first: the offset then keeps its precision at any distance from the
            // origin.
            let middle_m = node.middle_m - self.eye_m;
            for instance in below {
                let packed = &instances.packed[instance];
                let Some(model) = self.models.get(packed.shape()) else { continue };
                let middle_m = middle_m + packed.offset_m();
                let bound_m = packed.radius_m(instances.largest_m) * model.bound;
                if cone.meets(middle_m, bound_m) {
                    found.push(Candidate { field, instance, middle_m: self.world_from_field * middle_m, bound_m });
                }
            }
        }
        found
    }

    /// Returns the intersection of a ray with an instance, as a pixel that the instance covers.
    fn meet(&self, candidate: &Candidate, ray: DVec3) -> Option<MeshPixel> {
        let instances = &self.lit.field.instances;
        let packed = &instances.packed[candidate.instance];
        let model = self.models.get(packed.shape())?;
        let along_m = candidate.middle_m.dot(ray);
        let across_m = ray.cross(candidate.middle_m).length();
        if across_m > candidate.bound_m || along_m < -candidate.bound_m {
            return None;
        }
        let radius_m = packed.radius_m(instances.largest_m);
        let world_from_shape = self.world_from_field * DMat3::from_quat(packed.field_from_shape(self.time_parts));
        let shape_from_world = world_from_shape.transpose();
        // Start where the ray enters the bounding sphere: distant asteroids keep their precision.
        let start_m = (along_m - (candidate.bound_m.powi(2) - across_m.powi(2)).max(0.0).sqrt()).max(0.0);
        let origin = shape_from_world * (ray * start_m - candidate.middle_m) / radius_m;
        let hit = model.tree.first_hit(origin, shape_from_world * ray)?;
        let triangle = model.mesh.triangles[hit.triangle];
        let (mut normal, mut albedo) = (DVec3::ZERO, 0.0);
        for (vertex, weight) in triangle.into_iter().zip(hit.weights) {
            normal += DVec3::from_array(model.mesh.normals[vertex as usize].map(f64::from)) * weight;
            albedo += f64::from(model.mesh.albedos[vertex as usize]) * weight;
        }
        let normal = (world_from_shape * normal).normalize_or_zero();
        let (cos_light, cos_eye) = (normal.dot(self.lit.towards_sun), -normal.dot(ray));
        // At the rim, an interpolated normal may face away from the eye although the triangle itself does not.
        let lit = cos_light > 0.0 && cos_eye > 0.0;
        let luminance = if lit { (self.lit.shade)(albedo, cos_light, cos_eye) * self.lit.illuminance_lx } else { 0.0 };
        Some(MeshPixel { coverage: 1.0, luminance, normal, distance_m: start_m + hit.distance * radius_m })
    }
}

/// Returns the solid angle of all asteroids in a picture, sr: coverage times the solid angle of each pixel.
pub fn covered_solid_angle_sr(image: &MeshImage, mapping: &dyn PlaneMapping) -> f64 {
    let width = image.size[0] as usize;
    let shares = image.pixels.iter().enumerate().filter(|(_, pixel)| pixel.coverage > 0.0);
    shares.map(|(k, pixel)| pixel.coverage * mapping.solid_angle_sr((k % width) as u32, (k / width) as u32)).sum()
}

/// Returns the solid angle of a sphere of `radius_m` at `distance_m`, sr.
pub fn sphere_solid_angle_sr(radius_m: f64, distance_m: f64) -> f64 {
    let sine = radius_m / distance_m;
    // This is 1 - sqrt(1 - s^2) without cancellation.
    2.0 * PI * sine * sine / (1.0 + (1.0 - sine * sine).sqrt())
}

#[cfg(test)]
mod tests;
