// The smooth part of scattered light: a grid of points over a picture, read between them. The importer binds `veil_grids` and
// `veil_points`.

// The grid of a viewport.
struct VeilGrid {
    // Index of its first point; the points lie row by row.
    first: u32,
    columns: u32,
    rows: u32,
    // Pixels from point to point; the first one lies on the picture's top left corner.
    spacing: u32,
}

// The column of a picture's pixels that is being read.
struct VeilColumn {
    grid: VeilGrid,
    // Points left of it, and how far it stands from them.
    left: u32,
    share: f32,
    // The run of rows that `top` and `bottom` hold; below 0 for none.
    held: f32,
    top: vec3<f32>,
    bottom: vec3<f32>,
}

fn veil_column(grid: VeilGrid, x: u32) -> VeilColumn {
    var column: VeilColumn;
    column.grid = grid;
    column.left = x / grid.spacing;
    column.share = (f32(x - column.left * grid.spacing) + 0.5) / f32(grid.spacing);
    column.held = -1.0;
    return column;
}

fn veil_points_between(column: VeilColumn, row: u32) -> vec3<f32> {
    let point = column.grid.first + row * column.grid.columns + column.left;
    return mix(veil_points[point].xyz, veil_points[point + 1u].xyz, column.share);
}

// Luminance in a row of the picture, cd/m^2.
fn veil_in_row(column: ptr<function, VeilColumn>, y: u32) -> vec3<f32> {
    // A product and no division of whole numbers, which CPUs do one by one: exact, since it is a half from the next whole number.
    let at = (f32(y) + 0.5) / f32((*column).grid.spacing);
    let above = floor(at);
    if above != (*column).held {
        (*column).held = above;
        (*column).top = veil_points_between(*column, u32(above));
        (*column).bottom = veil_points_between(*column, u32(above) + 1u);
    }
    return mix((*column).top, (*column).bottom, at - above);
}
