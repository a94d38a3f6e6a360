//! Culling and detail on the CPU, in f64: every asteroid of every field against every picture, sequentially, as in renderers
//! without compute shaders. The lists are those of `shaders/asteroids/cull.wgsl`, except for f32 rounding.

use glam::{DMat3, DVec3};

use super::{
    classes::{Class, ClassRules},
    kinds::Kinds,
    views::{PictureBounds, PictureKind, touches_face},
};
use crate::{
    scene::asteroids::{AsteroidField, PackedAsteroid},
    view::projection::Face,
};

/// An asteroid in a list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ListEntry {
    /// Index of the asteroid among those of all fields.
    pub instance: u32,
    /// Index of its group's item.
    pub item: u32,
    /// Whether it is drawn on the other side of the seam.
    pub beyond_seam: bool,
    /// 2: the only form; w: a new form with the share w; -w: the previous form, with the share 1 - w that remains next to the new form.
    pub fade: f32,
}

/// Lists of one picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureLists {
    /// Visible asteroids, including points.
    pub seen: u64,
    /// Lists by kind: those of the faces behind the picture (0 to 5), then those of the picture itself (6).
    pub lists: [Vec<Vec<ListEntry>>; 7],
}

/// Index of the picture itself in [`PictureLists::lists`].
pub const WHOLE_PICTURE: usize = 6;

/// Fade of a form that is drawn alone.
pub const WHOLE: f32 = 2.0;

/// Least magnitude of a share in a fade, so that its sign is preserved.
pub const LEAST_SHARE: f64 = 1e-6;

/// Culls all `fields` for a camera at `camera_m`. Items are numbered in the order of the groups: all groups of one field, then those of the next.
pub fn cull(
    fields: &[&AsteroidField],
    kinds: &Kinds,
    camera_m: DVec3,
    pictures: &[PictureBounds],
    rules: &[ClassRules],
) -> Vec<PictureLists> {
    let mut found: Vec<PictureLists> = pictures
        .iter()
        .map(|_| PictureLists { seen: 0, lists: std::array::from_fn(|_| vec![Vec::new(); kinds.lists()]) })
        .collect();
    let mut item = 0;
    for (index, field) in fields.iter().enumerate() {
        let rotation = DMat3::from_quat(field.orientation);
        for node in field.instances.levels.first().into_iter().flatten() {
            let origin_m = field.position_m - camera_m + rotation * node.middle_m;
            for i in node.first..node.first + node.count {
                let asteroid = &field.instances.packed[i as usize];
                let place_m = origin_m + rotation * asteroid.offset_m();
                let instance = (kinds.first_instance[index] + i as usize) as u32;
                let seen = Asteroid { field, index, kinds, asteroid, place_m, instance, item };
                for (picture, lists) in pictures.iter().zip(rules).zip(&mut found) {
                    seen.show(picture.0, picture.1, lists);
                }
            }
            item += 1;
        }
    }
    found
}

struct Asteroid<'a> {
    field: &'a AsteroidField,
    index: usize,
    kinds: &'a Kinds,
    asteroid: &'a PackedAsteroid,
    place_m: DVec3,
    instance: u32,
    item: u32,
}

impl Asteroid<'_> {
    fn show(&self, picture: &PictureBounds, rules: &ClassRules, found: &mut PictureLists) {
        let set = self.kinds.set(self.index);
        let shape_index = self.asteroid.shape().min(set.shapes.shapes.len() - 1);
        let shape = &set.shapes.shapes[shape_index];
        let radius_m = self.asteroid.radius_m(self.field.instances.largest_m);
        let bound_m = shape.bound * radius_m;
        let middle = picture.view_from_world * (self.place_m - picture.eye_m);
        let distance_m = middle.length();
        if !picture.touches(middle, bound_m) || distance_m <= 0.0 || radius_m <= 0.0 {
            return;
        }
        found.seen += 1;
        // Forms of the asteroid, with their shares.
        let place = picture.place_of(middle, distance_m);
        let errors = shape.lods.iter().map(|lod| lod.error);
        let classes = rules.classes(errors, shape.bound, radius_m, distance_m, picture.table.pixel_rad_at(place));
        let share = classes.share.max(LEAST_SHARE) as f32;
        let drawn =
            [(Some(classes.class), if classes.before.is_some() { share } else { WHOLE }), (classes.before, -share)];
        // Whether its straight edges bend so much that it must be drawn through cube faces.
        let edge_of = |class: Class| match class {
            Class::Mesh(level) => shape.lods[level as usize].longest_edge,
            Class::Impostor | Class::Point => 2.0 * shape.bound,
        };
        let edge = drawn.iter().filter_map(|(class, _)| class.map(edge_of)).fold(0.0, f64::max);
        let through_faces = picture.kind != PictureKind::Flat
            && bends(picture, rules, place, edge, bound_m / radius_m, radius_m / distance_m);
        // Entries of the lists.
        for (class, fade) in drawn {
            let kind = match class {
                Some(Class::Mesh(level)) => set.shape_kinds[shape_index] + level as usize,
                Some(Class::Impostor) => self.kinds.impostor_kind(self.kinds.set_of_field[self.index]),
                Some(Class::Point) | None => continue,
            };
            let entry = ListEntry { instance: self.instance, item: self.item, beyond_seam: false, fade };
            if through_faces {
                for face in Face::ALL.into_iter().filter(|face| touches_face(*face, middle, bound_m)) {
                    found.lists[face as usize][kind].push(entry);
                }
            } else {
                let list = &mut found.lists[WHOLE_PICTURE][kind];
                list.push(entry);
                if picture.crosses_seam(middle, bound_m) {
                    list.push(ListEntry { beyond_seam: true, ..entry });
                }
            }
        }
    }
}

/// Whether the images of edges of `edge` mean radii bend by more than half a pixel. `size` is the radius divided by the distance.
fn bends(picture: &PictureBounds, rules: &ClassRules, place: f64, edge: f64, bound: f64, size: f64) -> bool {
    if bound * size >= 0.5 {
        return true;
    }
    let bend = picture.table.bend_around(place, 0.53 * bound * size);
    (edge * size).powi(2) / 8.0 * bend * rules.quality > 0.5
}
