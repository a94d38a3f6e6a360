//! Light of asteroid fields as sources of glare: a few nodes of their trees, each an extended source of light.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::cut::{node_intensity_cd, strongest_light};
use crate::{
    photometry::rec709::luminance,
    plan::glare::objects::ExtendedSource,
    scene::{
        SceneObjects,
        asteroids::{AsteroidField, Node},
        bodies::Sun,
    },
    view::Viewport,
};

/// Maximum number of clouds of an eye.
const MOST_CLOUDS: usize = 64;
/// A node with at most this angular radius is not divided, rad.
const FINE_RAD: f64 = 0.03;
/// Clouds with a smaller fraction of all light are not divided.
const LEAST_SHARE: f64 = 1e-3;

/// A part of a field, as seen by an eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cloud {
    /// Its total light.
    pub source: ExtendedSource,
    /// Luminance of those of its surfaces that face both the sun and the eye: p E / pi, cd/m^2.
    pub surface_cd_m2: f64,
}

/// A node that may be divided.
struct Open<'a> {
    field: &'a AsteroidField,
    level: usize,
    node: &'a Node,
    cloud: Cloud,
}

/// Clouds of the fields for an eye at `eye_m`, world axes: the widest nodes are divided first.
pub fn field_clouds(fields: &[&AsteroidField], eye_m: DVec3, suns: &[Sun]) -> Vec<Cloud> {
    // Source of light for a node.
    let open = |field: &'_ AsteroidField, node: &Node| -> Cloud {
        let place_m = field.position_m + DMat3::from_quat(field.orientation) * node.centroid_m;
        let offset_m = place_m - eye_m;
        let light = strongest_light(suns, place_m);
        let distance_m = offset_m.length().max(f64::MIN_POSITIVE);
        let intensity_cd = node_intensity_cd(field, node, offset_m, light);
        let reflected = [0, 1, 2].map(|channel| field.geometric_albedo[channel] * light.1[channel]);
        let source = ExtendedSource {
            direction: offset_m / distance_m,
            // If the eye is among the asteroids, use the radius of the node as the distance.
            light: intensity_cd.map(|cd| cd / distance_m.max(node.radius_m).powi(2)),
            radius_rad: (node.radius_m / distance_m).min(1.0).asin(),
        };
        Cloud { source, surface_cd_m2: luminance(reflected) / std::f64::consts::PI }
    };
    // Start with the roots, and divide the widest and brightest nodes.
    let mut nodes: Vec<Open<'_>> = fields
        .iter()
        .filter_map(|field| {
            let level = field.instances.levels.len().checked_sub(1)?;
            let node = field.instances.levels[level].first()?;
            Some(Open { field, level, node, cloud: open(field, node) })
        })
        .take(MOST_CLOUDS)
        .collect();
    let all_lx: f64 = nodes.iter().map(|open| luminance(open.cloud.source.light)).sum();
    loop {
        let divisible = |open: &Open<'_>| {
            open.level > 0
                && open.cloud.source.radius_rad > FINE_RAD
                && luminance(open.cloud.source.light) > LEAST_SHARE * all_lx
                && nodes.len() + open.node.count as usize <= MOST_CLOUDS + 1
        };
        let weight = |open: &Open<'_>| open.cloud.source.radius_rad * luminance(open.cloud.source.light);
        let widest = (0..nodes.len())
            .filter(|index| divisible(&nodes[*index]))
            .max_by(|a, b| weight(&nodes[*a]).total_cmp(&weight(&nodes[*b])));
        let Some(widest) = widest else { break };
        let Open { field, level, node, .. } = nodes.swap_remove(widest);
        let below = &field.instances.levels[level - 1];
        let children = &below[node.first as usize..(node.first + node.count) as usize];
        nodes.extend(children.iter().map(|node| Open { field, level: level - 1, node, cloud: open(field, node) }));
    }
    nodes.into_iter().map(|open| open.cloud).filter(|cloud| luminance(cloud.source.light) > 0.0).collect()
}

/// Asteroid fields as the eye of each viewport sees them; empty without fields.
pub fn clouds_of(objects: &SceneObjects, suns: &[Sun], camera_m: DVec3, viewports: &[Viewport]) -> Vec<Vec<Cloud>> {
    if objects.fields.is_empty() {
        return Vec::new();
    }
    let fields: Vec<&AsteroidField> = objects.fields.iter().map(Arc::as_ref).collect();
    let mut clouds: Vec<Vec<Cloud>> = Vec::with_capacity(viewports.len());
    for (index, viewport) in viewports.iter().enumerate() {
        // Eyes at the same position have the same sources.
        let same = viewports[..index].iter().position(|other| other.eye_offset_m == viewport.eye_offset_m);
        clouds.push(match same {
            Some(other) => clouds[other].clone(),
            None => field_clouds(&fields, camera_m + viewport.eye_offset_m, suns),
        });
    }
    clouds
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]

    use super::*;
    use crate::scene::{
        asteroids::{FieldParameters, Instances, Placement, ShapeSet},
        bodies::ReflectionLaw,
    };

    fn field() -> AsteroidField {
        let parameters = FieldParameters {
            instances: 20_000,
            seed: 4,
            placement: Placement::Ring { inner_m: 8e6, outer_m: 1e7, thickness_m: 1e5 },
            radius_m: [10.0, 500.0],
            size_index: 1.5,
            spin_period_s: [1e4, 1e5],
        };
        AsteroidField {
            name: "ring".to_owned(),
            position_m: DVec3::new(1e11, 0.0, 0.0),
            orientation: glam::DQuat::IDENTITY,
            law: ReflectionLaw::Lambert,
            geometric_albedo: [0.1; 3],
            instances: Arc::new(Instances::place(&parameters, 1, &[1.5]).unwrap()),
            shapes: Arc::new(ShapeSet::default()),
        }
    }

    /// From a great distance all sources have the same phase angle, so their total is the light of all asteroids. Nearby, there are many sources.
    #[test]
    fn clouds_have_the_light_of_their_asteroids() {
        let field = field();
        let sun = Sun {
            position_m: DVec3::ZERO,
            intensity_cd: [3e27; 3],
            radius_m: 7e8,
            occluders: [].into(),
            reflectors: [].into(),
            year: 2000.0,
        };
        let eye_m = field.position_m - DVec3::new(1e9, 2e8, 5e7);
        let clouds = field_clouds(&[&field], eye_m, std::slice::from_ref(&sun));
        let light: f64 = clouds.iter().map(|cloud| luminance(cloud.source.light)).sum();
        let area_m2: f64 = field.instances.levels[0].iter().map(|node| node.area_m2).sum();
        let offset_m = field.position_m - eye_m;
        let phase = field.law.phase_function((-offset_m).angle_between(-field.position_m));
        let full = 0.1 * 3e27 / 1e22 * area_m2 / std::f64::consts::PI / offset_m.length_squared() * phase;
        assert!((light / full - 1.0).abs() < 2e-3, "{light} {full}");
        // Luminance for an albedo of 0.1 in 3e5 lx.
        let surface = 0.1 * 3e27 / 1e22 / std::f64::consts::PI;
        assert!(clouds.iter().all(|cloud| (cloud.surface_cd_m2 / surface - 1.0).abs() < 1e-3), "{clouds:?}");
        let near = field_clouds(&[&field], field.position_m + DVec3::new(9e6, 0.0, 1e6), &[sun]);
        assert!(near.len() > 30 && near.len() <= MOST_CLOUDS, "{}", near.len());
        assert!(near.iter().all(|cloud| cloud.source.light.iter().all(|lx| lx.is_finite() && *lx > 0.0)));
    }
}
