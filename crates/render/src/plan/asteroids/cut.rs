//! Groups of asteroids that may be visible in each picture. They are computed in f64, once per frame, by descending the trees of the fields.
//!
//! A node outside all pictures is dropped with its children. A node that is smaller than half a pixel in every picture, and whose asteroids are all
//! points there, becomes one point of light. Each remaining group lists the pictures in which it may be visible and the faces of the cubes behind
//! pictures that are not flat, and states whether it may contain points or larger forms. Decisions about single asteroids are made later, on the
//! adapter (`shaders/asteroids/cull.wgsl`) or in `cpu_cull`.
//!
//! An asteroid whose straight edges would bend by more than half a pixel (divided by the quality) is drawn through faces. The bound here is for a
//! whole group, so it includes every face that one of its asteroids needs.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{
    classes::ClassRules,
    views::{PictureBounds, PictureKind, touches_face},
};
use crate::{
    photometry::rec709::luminance,
    plan::bodies::seen::PointSource,
    scene::{
        asteroids::{AsteroidField, Node},
        bodies::Sun,
    },
    view::projection::Face,
};

/// Factor by which the bounds of a group exceed those of its asteroids: a margin, because the decisions about single asteroids are made in f32.
const SLACK: f64 = 1.02;

/// A node that is drawn as one point of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnresolvedNode {
    /// The point.
    pub point: PointSource,
    /// Number of asteroids of the node.
    pub asteroids: u64,
}

/// A group that may be visible in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupItem {
    /// Index of its field.
    pub field: usize,
    /// Index of its node on level 0.
    pub node: usize,
    /// Its centre minus the camera, world axes, m.
    pub origin_m: DVec3,
    /// First asteroid of the field.
    pub first: u32,
    /// Number of asteroids.
    pub count: u32,
    /// Bit i: visible in viewport i.
    pub viewports: u64,
    /// Indices of pictures that are not flat, and the faces (one bit per [`Face`]) that the group may need there.
    pub faces: Vec<(usize, u8)>,
    /// Whether it crosses the seam of a picture.
    pub crosses_seam: bool,
    /// Direction to the sun, unit vector, world axes; 0 without a sun.
    pub sun: DVec3,
    /// Illuminance of a surface that faces the sun, lx.
    pub illuminance_lx: [f64; 3],
    /// Whether any of its asteroids may be drawn as a point.
    pub holds_points: bool,
    /// Whether any of its asteroids may be drawn as a mesh or an impostor.
    pub holds_shapes: bool,
}

/// Groups and points of all fields in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AsteroidCut {
    /// Groups: first those that may contain meshes or impostors.
    pub items: Vec<GroupItem>,
    /// Number of groups that may contain meshes or impostors.
    pub shape_items: usize,
    /// Nodes that are drawn as points of light.
    pub unresolved: Vec<UnresolvedNode>,
    /// Faces of the cube that each viewport needs, as bit sets.
    pub faces: Vec<u8>,
    /// Bound of the light of all points except unresolved nodes, per viewport, lx, in the brightest channel.
    pub points_lx: Vec<f64>,
    /// Greatest illuminance on any group, in the brightest channel, lx.
    pub brightest_lx: f64,
}

/// Parameters of a field for the cut.
struct FieldCut<'a> {
    field: &'a AsteroidField,
    rotation: DMat3,
    /// Centre of the field minus the camera, m.
    origin_m: DVec3,
    /// Longest edge of any level, mean radii.
    longest_edge: f64,
    /// Radius of the sphere that contains any shape, mean radii.
    largest_bound: f64,
    /// Upper bound of the projected area of a shape, divided by pi r^2.
    largest_area: f64,
}

/// Result for a node.
enum Outcome {
    Node { field: usize, level: usize, node: usize, viewports: u64 },
    Point(UnresolvedNode, f64),
    Group(Box<GroupItem>, f64),
}

/// Cuts the trees of `fields` for the pictures of a camera at `camera_m`. `pixel_quality` is the factor on the distances of detail.
pub fn cut(
    fields: &[&AsteroidField],
    camera_m: DVec3,
    pictures: &[PictureBounds],
    rules: &[ClassRules],
    suns: &[Sun],
) -> AsteroidCut {
    // Start with the roots of all trees, visible in all pictures.
    let prepared: Vec<FieldCut<'_>> = fields.iter().map(|field| FieldCut::new(field, camera_m)).collect();
    let all = if pictures.len() >= 64 { u64::MAX } else { (1 << pictures.len()) - 1 };
    let mut level_nodes: Vec<Outcome> = Vec::new();
    for (index, field) in fields.iter().enumerate() {
        if let Some(level) = field.instances.levels.len().checked_sub(1) {
            let nodes = 0..field.instances.levels[level].len();
            level_nodes.extend(nodes.map(|node| Outcome::Node { field: index, level, node, viewports: all }));
        }
    }
    let scene = NodeCut { fields: &prepared, pictures, rules, suns, camera_m };
    let mut cut =
        AsteroidCut { faces: vec![0; pictures.len()], points_lx: vec![0.0; pictures.len()], ..Default::default() };
    let mut points_only = Vec::new();
    // Level by level; the heights of the trees may differ.
    while !level_nodes.is_empty() {
        let found: Vec<Outcome> = level_nodes.into_par_iter().flat_map_iter(|outcome| scene.look(&outcome)).collect();
        level_nodes = Vec::new();
        for outcome in found {
            match outcome {
                Outcome::Node { .. } => level_nodes.push(outcome),
                Outcome::Point(node, brightest) => {
                    cut.brightest_lx = cut.brightest_lx.max(brightest);
                    cut.unresolved.push(node);
                }
                Outcome::Group(item, points_lx) => {
                    let brightest = item.illuminance_lx.into_iter().fold(0.0, f64::max);
                    cut.add_light(item.viewports, if item.holds_points { points_lx } else { 0.0 }, brightest);
                    for (viewport, faces) in &item.faces {
                        cut.faces[*viewport] |= faces;
                    }
                    if item.holds_shapes {
                        cut.items.push(*item);
                    } else {
                        points_only.push(*item);
                    }
                }
            }
        }
    }
    // Sort from near to far: nearer asteroids are drawn first, so that most hidden ones are recognised as hidden.
    cut.items.sort_by(|a, b| a.origin_m.length_squared().total_cmp(&b.origin_m.length_squared()));
    cut.shape_items = cut.items.len();
    cut.items.append(&mut points_only);
    cut
}

/// All groups, visible or not: the input of culling on the CPU.
pub fn every_group(
    fields: &[&AsteroidField],
    camera_m: DVec3,
    pictures: &[PictureBounds],
    rules: &[ClassRules],
    suns: &[Sun],
) -> AsteroidCut {
    // Start with the roots of all trees, visible in all pictures.
    let prepared: Vec<FieldCut<'_>> = fields.iter().map(|field| FieldCut::new(field, camera_m)).collect();
    let scene = NodeCut { fields: &prepared, pictures, rules, suns, camera_m };
    let viewports = if pictures.len() >= 64 { u64::MAX } else { (1 << pictures.len()) - 1 };
    let mut cut =
        AsteroidCut { faces: vec![0; pictures.len()], points_lx: vec![0.0; pictures.len()], ..Default::default() };
    for (index, field) in prepared.iter().enumerate() {
        for (node_index, node) in field.field.instances.levels.first().into_iter().flatten().enumerate() {
            let mut item = scene.group(index, node_index, viewports);
            (item.holds_points, item.holds_shapes) = (true, true);
            let brightest = item.illuminance_lx.into_iter().fold(0.0, f64::max);
            cut.add_light(viewports, scene.points_lx(field, node, &item), brightest);
            cut.items.push(item);
        }
    }
    cut.shape_items = cut.items.len();
    cut
}

impl AsteroidCut {
    fn add_light(&mut self, viewports: u64, lx: f64, brightest_lx: f64) {
        for (viewport, sum) in self.points_lx.iter_mut().enumerate() {
            if viewports >> viewport & 1 == 1 {
                *sum += lx;
            }
        }
        self.brightest_lx = self.brightest_lx.max(brightest_lx);
    }
}

impl<'a> FieldCut<'a> {
    fn new(field: &'a AsteroidField, camera_m: DVec3) -> Self {
        let shapes = &field.shapes.shapes;
        let largest_bound = shapes.iter().map(|shape| shape.bound).fold(0.0, f64::max);
        let longest = shapes.iter().flat_map(|shape| &shape.lods).map(|lod| lod.longest_edge).fold(0.0, f64::max);
        Self {
            field,
            rotation: DMat3::from_quat(field.orientation),
            origin_m: field.position_m - camera_m,
            longest_edge: longest,
            largest_bound,
            largest_area: largest_bound * largest_bound,
        }
    }
}

/// Inputs for decisions about nodes.
struct NodeCut<'a> {
    fields: &'a [FieldCut<'a>],
    pictures: &'a [PictureBounds],
    rules: &'a [ClassRules],
    suns: &'a [Sun],
    camera_m: DVec3,
}

impl NodeCut<'_> {
    /// Decides about a node: nothing, a point, a group, or its children.
    fn look(&self, outcome: &Outcome) -> Vec<Outcome> {
        let &Outcome::Node { field: index, level, node: node_index, viewports: parents } = outcome else {
            return vec![];
        };
        let field = &self.fields[index];
        let node = &field.field.instances.levels[level][node_index];
        let middle_m = field.origin_m + field.rotation * node.middle_m;
        // Viewports in which the node may be visible, and the forms of its asteroids there.
        let mut viewports = 0;
        let mut unresolved = true;
        let (mut holds_points, mut holds_shapes) = (false, false);
        let mut remaining = parents;
        while remaining != 0 {
            let viewport = remaining.trailing_zeros() as usize;
            remaining &= remaining - 1;
            let (picture, rules) = (&self.pictures[viewport], &self.rules[viewport]);
            let from_eye = picture.view_from_world * (middle_m - picture.eye_m);
            if !picture.touches(from_eye, node.radius_m) {
                continue;
            }
            viewports |= 1 << viewport;
            let distance_m = from_eye.length();
            let [nearest_m, farthest_m] = [(distance_m - node.radius_m).max(0.0), distance_m + node.radius_m];
            let [finest_rad, coarsest_rad] = picture.table.pixel_range_rad();
            let points = !rules.finest_only && farthest_m * SLACK >= rules.quality * node.smallest_m / coarsest_rad;
            let only_points =
                !rules.finest_only && nearest_m >= SLACK * 2.0 * rules.quality * node.largest_m / finest_rad;
            holds_points |= points;
            holds_shapes |= !only_points;
            unresolved &= only_points && 2.0 * node.radius_m * rules.quality <= 0.5 * finest_rad * nearest_m;
        }
        // Drop the node, draw it as a point, descend, or make it a group.
        if viewports == 0 {
            return vec![];
        }
        if unresolved {
            return vec![self.point(field, level, node, viewports)];
        }
        if level > 0 {
            let children = node.first as usize..node.first as usize + node.count as usize;
            return children.map(|node| Outcome::Node { field: index, level: level - 1, node, viewports }).collect();
        }
        let mut item = self.group(index, node_index, viewports);
        (item.holds_points, item.holds_shapes) = (holds_points, holds_shapes);
        let points_lx = self.points_lx(field, node, &item);
        if holds_shapes {
            self.add_faces(field, node, &mut item);
        }
        vec![Outcome::Group(Box::new(item), points_lx)]
    }

    /// Makes a group, without the data that depends on the pictures.
    fn group(&self, index: usize, node_index: usize, viewports: u64) -> GroupItem {
        let field = &self.fields[index];
        let node = &field.field.instances.levels[0][node_index];
        let origin_m = field.origin_m + field.rotation * node.middle_m;
        let (sun, illuminance_lx) = self.sunlight(origin_m);
        GroupItem {
            field: index,
            node: node_index,
            origin_m,
            first: node.first,
            count: node.count,
            viewports,
            faces: Vec::new(),
            crosses_seam: false,
            sun,
            illuminance_lx,
            holds_points: false,
            holds_shapes: false,
        }
    }

    /// Adds the faces that a group may need, and whether it crosses a seam.
    fn add_faces(&self, field: &FieldCut<'_>, node: &Node, item: &mut GroupItem) {
        let mut remaining = item.viewports;
        while remaining != 0 {
            let viewport = remaining.trailing_zeros() as usize;
            remaining &= remaining - 1;
            let (picture, rules) = (&self.pictures[viewport], &self.rules[viewport]);
            if picture.kind == PictureKind::Flat {
                continue;
            }
            let from_eye = picture.view_from_world * (item.origin_m - picture.eye_m);
            item.crosses_seam |= picture.crosses_seam(from_eye, node.radius_m * SLACK);
            let distance_m = from_eye.length();
            let nearest_m = distance_m - node.radius_m;
            let size = SLACK * node.largest_m / nearest_m.max(f64::MIN_POSITIVE);
            let bends = size * field.largest_bound >= 0.5 || {
                let place = picture.place_of(from_eye, distance_m);
                let reach = 0.55 * (node.radius_m / distance_m).min(1.0).asin();
                let of_impostor = if picture.impostor.is_some() { 2.0 * field.largest_bound } else { 0.0 };
                let length = field.longest_edge.max(of_impostor) * size;
                length * length / 8.0 * picture.table.bend_around_all(place, reach) * rules.quality > 0.5
            };
            if bends {
                let faces = Face::ALL.iter().filter(|face| touches_face(**face, from_eye, node.radius_m * SLACK));
                item.faces.push((viewport, faces.fold(0, |bits, face| bits | 1 << *face as u8)));
            }
        }
    }

    /// Direction and illuminance of the strongest sun at a position relative to the camera.
    fn sunlight(&self, middle_m: DVec3) -> (DVec3, [f64; 3]) {
        let place_m = self.camera_m + middle_m;
        strongest_light(self.suns, place_m)
    }

    /// A whole node as one point at its centroid, with the light of spheres of equal area.
    fn point(&self, field: &FieldCut<'_>, level: usize, node: &Node, viewports: u64) -> Outcome {
        let offset_m = field.origin_m + field.rotation * node.centroid_m;
        let light = self.sunlight(offset_m);
        let intensity_cd = node_intensity_cd(field.field, node, offset_m, light);
        let asteroids = instances_below(field.field, level, node);
        let point = PointSource { offset_m, intensity_cd, radius_m: node.radius_m, viewports };
        Outcome::Point(UnresolvedNode { point, asteroids }, light.1.into_iter().fold(0.0, f64::max))
    }

    fn nearest_m(&self, middle_m: DVec3, radius_m: f64, viewports: u64) -> f64 {
        let seeing = self.pictures.iter().enumerate().filter(|(viewport, _)| viewports >> viewport & 1 == 1);
        seeing.map(|(_, picture)| (middle_m - picture.eye_m).length() - radius_m).fold(f64::INFINITY, f64::min).max(0.0)
    }

    /// Bound of the light of all points of a group, lx. A point is at least at the distance at which the diameter of its asteroid is two pixels.
    fn points_lx(&self, field: &FieldCut<'_>, node: &Node, item: &GroupItem) -> f64 {
        let albedo = field.field.geometric_albedo;
        let full_cd = (0..3).map(|i| albedo[i] * item.illuminance_lx[i]).fold(0.0, f64::max) * field.largest_area;
        let nearest_m = self.nearest_m(item.origin_m, node.radius_m, item.viewports);
        let by_distance = node.area_m2 / std::f64::consts::PI / (nearest_m * nearest_m).max(f64::MIN_POSITIVE);
        let coarsest = self
            .pictures
            .iter()
            .zip(self.rules)
            .map(|(picture, rules)| picture.table.pixel_range_rad()[1] / rules.quality);
        let by_size = f64::from(node.count) * coarsest.fold(0.0, f64::max).powi(2);
        full_cd * by_distance.min(by_size) * (1.0 + 1e-3)
    }
}

/// Direction to the sun with the strongest light at a position, and that light, lx; 0 without a sun.
pub(super) fn strongest_light(suns: &[Sun], place_m: DVec3) -> (DVec3, [f64; 3]) {
    let lights = suns.iter().map(|sun| {
        let to_sun = sun.position_m - place_m;
        let distance_m = to_sun.length();
        let squared = (distance_m * distance_m).max(f64::MIN_POSITIVE);
        (to_sun / distance_m.max(f64::MIN_POSITIVE), sun.intensity_cd.map(|cd| cd / squared))
    });
    lights
        .fold(None, |best: Option<(DVec3, [f64; 3])>, light| match best {
            Some(best) if luminance(best.1) >= luminance(light.1) => Some(best),
            _ => Some(light),
        })
        .unwrap_or((DVec3::ZERO, [0.0; 3]))
}

/// Intensity of all asteroids of a node towards an eye at `-offset_m` from its centroid, as spheres of their mean areas, cd.
pub(super) fn node_intensity_cd(
    field: &AsteroidField,
    node: &Node,
    offset_m: DVec3,
    (sun, illuminance_lx): (DVec3, [f64; 3]),
) -> [f64; 3] {
    let distance_m = offset_m.length();
    let cos_phase = if distance_m > 0.0 { sun.dot(-offset_m / distance_m) } else { 1.0 };
    let phase = field.law.phase_function(cos_phase.clamp(-1.0, 1.0).acos());
    let albedo = field.geometric_albedo;
    std::array::from_fn(|i| albedo[i] * illuminance_lx[i] * node.area_m2 / std::f64::consts::PI * phase)
}

/// Number of asteroids of a node: children are contiguous, so it follows from the first and the last leaf.
fn instances_below(field: &AsteroidField, level: usize, node: &Node) -> u64 {
    let (mut first, mut last) = (node, node);
    for nodes in field.instances.levels[..level].iter().rev() {
        first = &nodes[first.first as usize];
        last = &nodes[(last.first + last.count - 1) as usize];
    }
    u64::from(last.first + last.count - first.first)
}
