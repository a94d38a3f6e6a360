//! Encodes the asteroid plan into GPU structures.
//!
//! No shader: encodes the plan.
//! No twin: encodes the plan.

use std::sync::Arc;

use glam::DMat3;

use crate::render::constants::{
    asteroid_classes::{VIEW_FLAT, VIEW_LONGITUDE, VIEW_ROUND},
    asteroid_instances::{ITEM_HOLDS_POINTS, ITEM_HOLDS_SHAPES},
    reflection::{LAW_LAMBERT, LAW_LOMMEL_SEELIGER},
};
use crate::{
    plan::{
        KernelPlan,
        asteroids::{
            AsteroidPlan,
            classes::ClassRules,
            cpu_cull::WHOLE_PICTURE,
            cut::GroupItem,
            kinds::{Kinds, Plane},
            views::{PictureBounds, PictureKind},
        },
    },
    render::{asteroids::layout, viewport::encode_viewport},
    scene::{SceneObjects, asteroids::AsteroidField, bodies::ReflectionLaw},
    view::{
        Viewport,
        projection::{Perspective, Projection},
    },
};

/// Encoded lists of a plan.
pub(super) struct Encoded {
    pub planes: Vec<layout::AsteroidPlane>,
    pub items: Vec<layout::AsteroidItem>,
    pub links: Vec<layout::AsteroidLink>,
    pub views: Vec<layout::AsteroidView>,
    pub tables: Vec<[f32; 2]>,
    pub fields: Vec<layout::AsteroidField>,
}

impl Encoded {
    pub(super) fn new(plan: &AsteroidPlan, objects: &SceneObjects) -> Self {
        let planes = plan.planes.iter().zip(&plan.plane_counts).map(|(plane, counts)| layout::AsteroidPlane {
            view: plane.viewport as u32,
            face: plane.face.map_or(WHOLE_PICTURE as u32, |face| face as u32),
            first_count: counts.first as u32,
            columns: counts.columns,
        });
        let items = plan.cut.items.iter().zip(&plan.item_links);
        let links = plan.links.iter().map(|link| layout::AsteroidLink {
            plane: link.plane as u32,
            column: link.column,
            faces: u32::from(link.faces),
            unused_0: 0,
        });
        let views = (0..).zip(&plan.pictures).zip(plan.rules.iter().zip(&plan.class_views));
        let tables = plan
            .pictures
            .iter()
            .flat_map(|picture| picture.table.pixel_rad.iter().zip(&picture.table.bend))
            .map(|(pixel, bend)| [*pixel as f32, *bend as f32]);
        let fields = objects.fields.iter().map(Arc::as_ref).enumerate();
        Self {
            planes: planes.collect(),
            items: items.map(|(item, [first, count])| encode_item(&plan.numbers, item, *first, *count)).collect(),
            links: links.collect(),
            views: views.map(|((i, picture), (rules, class))| encode_view(i, picture, rules, *class)).collect(),
            tables: tables.collect(),
            fields: fields.map(|(i, field)| encode_field(&plan.numbers, objects, i, field)).collect(),
        }
    }
}

/// Encodes the viewport of a plane: a picture, or one face of the cube behind it.
pub(super) fn encoded_viewport(plan: &AsteroidPlan, plane: &Plane) -> layout::Viewport {
    let viewport = &plan.viewports[plane.viewport];
    match plane.face {
        None => encode_viewport(viewport, &KernelPlan::bspline()),
        Some(face) => {
            let side = plan.face_px[plane.viewport];
            let behind = Viewport {
                projection: Projection::Perspective(Perspective::from_tangents([side; 2], [-1.0, 1.0, -1.0, 1.0])),
                world_from_view: viewport.world_from_view * face.cube_from_face(),
                ..viewport.clone()
            };
            encode_viewport(&behind, &KernelPlan::bspline())
        }
    }
}

fn encode_item(numbers: &Kinds, item: &GroupItem, first_link: u32, link_count: u32) -> layout::AsteroidItem {
    let origin = item.origin_m.as_vec3();
    let low = (item.origin_m - origin.as_dvec3()).as_vec3();
    layout::AsteroidItem {
        origin: origin.to_array(),
        first: numbers.first_instance[item.field] as u32 + item.first,
        origin_low: low.to_array(),
        count: item.count,
        sun: item.sun.as_vec3().to_array(),
        field: item.field as u32,
        illuminance: item.illuminance_lx.map(|lx| lx as f32),
        flags: (u32::from(item.holds_points) * ITEM_HOLDS_POINTS) | (u32::from(item.holds_shapes) * ITEM_HOLDS_SHAPES),
        viewports: [item.viewports as u32, (item.viewports >> 32) as u32],
        first_link,
        link_count,
    }
}

fn encode_field(numbers: &Kinds, objects: &SceneObjects, index: usize, field: &AsteroidField) -> layout::AsteroidField {
    let rotation = DMat3::from_quat(field.orientation);
    let row = |i: usize, w: f64| rotation.row(i).extend(w).as_vec4().to_array();
    let set = numbers.set(index);
    layout::AsteroidField {
        world_from_field_x: row(0, field.instances.largest_m / 65535.0),
        world_from_field_y: row(1, 0.0),
        world_from_field_z: row(2, 0.0),
        albedo: field.geometric_albedo.map(|albedo| albedo as f32),
        law: match field.law {
            ReflectionLaw::Lambert => LAW_LAMBERT,
            ReflectionLaw::LommelSeeliger => LAW_LOMMEL_SEELIGER,
        },
        time_parts: field.instances.time_parts(objects.time_s),
        first_shape: set.first_shape as u32,
        shape_count: set.shapes.shapes.len() as u32,
        first_kind: set.first_kind as u32,
        kinds: set.meshes as u32,
        impostor_kind: numbers.impostor_kind(numbers.set_of_field[index]) as u32,
        ..Default::default()
    }
}

fn encode_view(index: u32, picture: &PictureBounds, rules: &ClassRules, class_view: u32) -> layout::AsteroidView {
    let row = |i: usize| picture.view_from_world.row(i).extend(picture.eye_m[i]).as_vec4().to_array();
    let [x, y] = match picture.planes.as_slice() {
        [left, right, down, up] => [[left.x, left.z, right.x, right.z], [down.y, down.z, up.y, up.z]],
        _ => [[0.0; 4]; 2],
    };
    layout::AsteroidView {
        view_from_world_x: row(0),
        view_from_world_y: row(1),
        view_from_world_z: row(2),
        edges_x: x.map(|value| value as f32),
        edges_y: y.map(|value| value as f32),
        cone_sine: picture.cone[0] as f32,
        cone_cosine: picture.cone[1] as f32,
        kind: match picture.kind {
            PictureKind::Flat => VIEW_FLAT,
            PictureKind::Round => VIEW_ROUND,
            PictureKind::Longitude => VIEW_LONGITUDE,
        },
        first_entry: index * picture.table.pixel_rad.len() as u32,
        impostor_eyes: picture.impostor.map_or(0.0, |impostor| impostor.eyes_m as f32),
        impostor_linear: picture.impostor.map_or(-1.0, |impostor| impostor.linear as f32),
        impostor_exponent: picture.impostor.map_or(0.0, |impostor| impostor.exponent as f32),
        quality: rules.quality as f32,
        finest_only: u32::from(rules.finest_only),
        class_view,
        ..Default::default()
    }
}
