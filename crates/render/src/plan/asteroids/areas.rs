//! Projected areas of shapes in each direction: these areas determine the light of an asteroid that is too small to be resolved.
//!
//! Silhouettes are drawn into a grid of cells, and a cell counts if its centre is covered. Directions are the
//! nodes of an octahedral map of 16 x 16 steps. Opposite directions have the same area, so only those with z >= 0 are
//! drawn.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::asteroids::{Mesh, Shape, silhouette::Silhouettes};

/// Nodes along a side of a table.
pub const AREA_NODES: usize = 17;

/// Cells along a side of the grid for outlines.
const CELLS: usize = 192;

/// Meshes with more triangles are replaced by the shape's coarsest mesh.
const MOST_TRIANGLES: usize = 5000;

/// Steps from the centre of the table to its sides.
const STEPS: isize = (AREA_NODES / 2) as isize;

/// Column and row of a node, counted from the centre of the table.
fn place_of(node: usize) -> [isize; 2] {
    [node % AREA_NODES, node / AREA_NODES].map(|index| index as isize - STEPS)
}

/// Whether the direction at a position in the table has z >= 0.
fn is_upper([x, y]: [isize; 2]) -> bool {
    x.abs() + y.abs() <= STEPS
}

/// Folds a position in one half of the table onto the other half: to the direction with the opposite z.
fn folded([x, y]: [isize; 2]) -> [isize; 2] {
    let sign = |value: isize| if value < 0 { -1 } else { 1 };
    [(STEPS - y.abs()) * sign(x), (STEPS - x.abs()) * sign(y)]
}

/// Direction of a node.
fn node_direction(node: usize) -> DVec3 {
    let place = place_of(node);
    let [x, y] = if is_upper(place) { place } else { folded(place) };
    let [column, row] = place;
    DVec3::from_array([x, y, STEPS - column.abs() - row.abs()].map(|steps| steps as f64)).normalize()
}

/// Projected areas of a shape divided by pi mean radii squared, at the nodes of its table, row by row.
pub fn projected_areas(shape: &Shape) -> Vec<f32> {
    let finest = shape.lods.first().filter(|lod| lod.mesh.triangles.len() <= MOST_TRIANGLES);
    let Some(lod) = finest.or(shape.lods.last()) else { return vec![0.0; AREA_NODES * AREA_NODES] };
    let nodes: Vec<usize> = (0..AREA_NODES * AREA_NODES).filter(|node| is_upper(place_of(*node))).collect();
    let directions: Vec<DVec3> = nodes.iter().map(|node| node_direction(*node)).collect();
    let areas = areas_along(&lod.mesh, shape.bound, &directions);
    let mut table = vec![0.0; AREA_NODES * AREA_NODES];
    for (node, area) in nodes.into_iter().zip(areas) {
        table[node] = (area / PI) as f32;
    }
    for node in (0..table.len()).filter(|node| !is_upper(place_of(*node))) {
        // The opposite direction: z, x and y change their signs.
        let [x, y] = folded(place_of(node)).map(|steps| STEPS - steps);
        table[node] = table[y as usize * AREA_NODES + x as usize];
    }
    table
}

/// Returns the areas of a mesh's outline, seen from the directions, in mean radii squared. `bound` is the radius of a sphere around the mesh.
fn areas_along(mesh: &Mesh, bound: f64, directions: &[DVec3]) -> Vec<f64> {
    let positions: Vec<DVec3> = mesh.positions.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
    let silhouettes = Silhouettes::new(&positions, &mesh.triangles);
    directions.par_iter().map(|direction| silhouettes.area(1.001 * bound, *direction, CELLS)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::asteroids::ShapeSet;

    #[test]
    fn every_node_has_the_area_along_its_direction() {
        let shape = &ShapeSet::procedural(3).shapes[1];
        let directions: Vec<DVec3> = (0..AREA_NODES * AREA_NODES).map(node_direction).collect();
        let drawn = areas_along(&shape.lods[0].mesh, shape.bound, &directions);
        for (node, (area, drawn)) in projected_areas(shape).into_iter().zip(drawn).enumerate() {
            assert!((f64::from(area) * PI / drawn - 1.0).abs() < 2e-3, "node {node}: {area} for {}", drawn / PI);
        }
        // The nodes at the middle of the table, at the middle of a side and in a corner.
        let directions = [144, 8, 0].map(node_direction);
        assert_eq!(directions, [DVec3::Z, DVec3::NEG_Y, DVec3::NEG_Z]);
    }

    #[test]
    fn areas_of_a_shape_have_a_mean_of_pi_and_those_of_a_cube_are_exact() {
        let set = ShapeSet::procedural(5);
        for shape in &set.shapes {
            let areas = projected_areas(shape);
            // Solid-angle weights of the nodes: an octahedral map is coarser towards the centres of its faces.
            let weight = |node: usize| {
                let direction = node_direction(node);
                direction.abs().element_sum().powi(-3).recip().recip()
            };
            let inner = |node: &usize| !node.is_multiple_of(AREA_NODES) && node / AREA_NODES > 0;
            let nodes = || (0..areas.len()).filter(inner);
            let mean = nodes().map(|node| weight(node) * f64::from(areas[node])).sum::<f64>()
                / nodes().map(weight).sum::<f64>();
            assert!((mean - 1.0).abs() < 0.03, "{mean}");
        }
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 });
        let side = |a: u32, b: u32, c: u32, d: u32| [[a, b, c], [a, c, d]];
        let sides = [
            side(0, 2, 3, 1),
            side(4, 5, 7, 6),
            side(0, 1, 5, 4),
            side(2, 6, 7, 3),
            side(0, 4, 6, 2),
            side(1, 3, 7, 5),
        ];
        let mesh = Mesh {
            positions: (0..8).map(corner).collect(),
            normals: (0..8).map(corner).collect(),
            albedos: vec![1.0; 8],
            triangles: sides.into_iter().flatten().collect(),
        };
        let directions = [DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::ONE, DVec3::new(0.2, -0.7, 0.4)];
        let units = directions.map(DVec3::normalize);
        for (unit, found) in units.into_iter().zip(areas_along(&mesh, 3f64.sqrt(), &units)) {
            let truth = 4.0 * unit.abs().element_sum();
            assert!((found / truth - 1.0).abs() < 0.02, "{unit}: {found} for {truth}");
        }
    }
}
