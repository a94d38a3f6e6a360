//! The octahedral map: the sphere of directions on a square of tiles, without singular points and without unused
//! tiles.
//!
//! A direction is divided by the sum of its absolute coordinates, which maps it onto an octahedron; the map shows the upper half from above, and the
//! four lower faces are folded out to the corners (Meyer, Suessmuth, Sussner, Stamminger, Greiner: "On floating-point normal vectors", 2010). Tile
//! centres are half a tile inside the border. Beyond a border the map continues at the mirrored position of the same border. Beyond a corner it
//! continues at the other three corners.
//!
//! Three tiles are blended by the corners of a triangle of the grid of tile centres. A face of the octahedron is flat on the map, and is divided into
//! equilateral triangles if cells are divided along the fold between upper and lower faces. A cell that crosses a border appears at two mirrored
//! positions of that border, and is divided in the same direction at both. On every edge of the grid, the weights are linear between its two tiles,
//! so they are continuous everywhere.

use glam::{DVec2, DVec3};

use super::{AtlasTile, TileAxes};

/// Position of a direction (any length but 0) on the map, from -1 to 1 along both axes.
pub fn encode(direction: DVec3) -> DVec2 {
    let sum = direction.abs().element_sum();
    let p = direction.truncate() / sum;
    if direction.z >= 0.0 { p } else { (DVec2::ONE - DVec2::new(p.y.abs(), p.x.abs())) * sign(p) }
}

/// Unit direction of a position.
pub fn decode(place: DVec2) -> DVec3 {
    let z = 1.0 - place.x.abs() - place.y.abs();
    let p = if z >= 0.0 { place } else { (DVec2::ONE - DVec2::new(place.y.abs(), place.x.abs())) * sign(place) };
    p.extend(z).normalize()
}

/// 1 or -1, never 0.
fn sign(p: DVec2) -> DVec2 {
    DVec2::new(if p.x >= 0.0 { 1.0 } else { -1.0 }, if p.y >= 0.0 { 1.0 } else { -1.0 })
}

/// Position of the centre of a tile.
pub fn middle(tile: AtlasTile, tiles: u32) -> DVec2 {
    (DVec2::new(f64::from(tile.column), f64::from(tile.row)) + 0.5) * (2.0 / f64::from(tiles)) - 1.0
}

/// The tile whose square contains a direction.
pub fn nearest(direction: DVec3, tiles: u32) -> AtlasTile {
    let index = |place: f64| (((place + 1.0) * 0.5 * f64::from(tiles)).floor().max(0.0) as u32).min(tiles - 1);
    let place = encode(direction);
    AtlasTile { column: index(place.x), row: index(place.y) }
}

/// The three tiles around a direction and their weights.
pub fn blended(direction: DVec3, tiles: u32) -> [(AtlasTile, f64); 3] {
    let grid = (encode(direction) + 1.0) * (0.5 * f64::from(tiles)) - 0.5;
    let n = i64::from(tiles);
    let cell = [grid.x, grid.y].map(|along| (along.floor() as i64).clamp(-1, n - 1));
    let fx = (grid.x - cell[0] as f64).clamp(0.0, 1.0);
    let fy = (grid.y - cell[1] as f64).clamp(0.0, 1.0);
    let tile_at = |x: i64, y: i64| wrapped(cell[0] + x, cell[1] + y, n);
    let over_border = cell.iter().any(|along| *along < 0 || *along >= n - 1);
    let falling = !over_border && (2 * cell[0] + 2 - n) * (2 * cell[1] + 2 - n) > 0;
    if falling {
        if fx + fy <= 1.0 {
            [(tile_at(0, 0), 1.0 - fx - fy), (tile_at(1, 0), fx), (tile_at(0, 1), fy)]
        } else {
            [(tile_at(1, 1), fx + fy - 1.0), (tile_at(1, 0), 1.0 - fy), (tile_at(0, 1), 1.0 - fx)]
        }
    } else if fx >= fy {
        [(tile_at(0, 0), 1.0 - fx), (tile_at(1, 0), fx - fy), (tile_at(1, 1), fy)]
    } else {
        [(tile_at(0, 0), 1.0 - fy), (tile_at(0, 1), fy - fx), (tile_at(1, 1), fx)]
    }
}

/// The tile at a position of the grid, which may be one step beyond a border.
fn wrapped(mut column: i64, mut row: i64, n: i64) -> AtlasTile {
    if column < 0 || column >= n {
        column = column.clamp(0, n - 1);
        row = n - 1 - row;
    }
    if row < 0 || row >= n {
        row = row.clamp(0, n - 1);
        column = n - 1 - column;
    }
    AtlasTile { column: column as u32, row: row as u32 }
}

/// Axes of a tile: right and up by Duff et al., "Building an orthonormal basis, revisited", JCGT 6 (2017). These
/// axes flip where z changes its sign, and the centres of many tiles are at z = 0: the sign is computed with integers,
/// so that it is the same in any precision.
pub fn axes(tile: AtlasTile, tiles: u32) -> TileAxes {
    let count = i64::from(tiles);
    let [x, y] = [tile.column, tile.row].map(|index| 2 * i64::from(index) + 1 - count);
    let z = count - x.abs() - y.abs();
    let p = DVec2::new(x as f64, y as f64);
    let folded = DVec2::new((count - y.abs()) as f64, (count - x.abs()) as f64) * sign(p);
    let n = if z >= 0 { p } else { folded }.extend(z as f64).normalize();
    let side = if z >= 0 { 1.0 } else { -1.0 };
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    TileAxes {
        right: DVec3::new(1.0 + side * n.x * n.x * a, side * b, -side * n.x),
        up: DVec3::new(b, side + n.y * n.y * a, -n.y),
        direction: n,
    }
}
