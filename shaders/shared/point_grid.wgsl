// Light that is smooth from pixel to pixel. It is evaluated at a grid of points over a picture, and interpolated. The importer binds `grid_points`.

#import structs/PointGrid

// Column of a picture's pixels that is being read.
struct GridColumn {
    grid: PointGrid,
    // Column of grid points to the left of it, and fraction of the way to the next column.
    left: u32,
    share: f32,
    // Row of points for which `top` and `bottom` are stored; negative: none.
    held: f32,
    top: vec3<f32>,
    bottom: vec3<f32>,
}

fn grid_column(grid: PointGrid, x: u32) -> GridColumn {
    var column: GridColumn;
    column.grid = grid;
    column.left = x >> grid.spacing_log2;
    column.share = (f32(x - column.left * grid.spacing) + 0.5) / f32(grid.spacing);
    column.held = -1.0;
    return column;
}

fn between_points(column: GridColumn, row: u32) -> vec3<f32> {
    let point = column.grid.first + row * column.grid.columns + column.left;
    return mix(grid_points[point].xyz, grid_points[point + 1u].xyz, column.share);
}

// Returns the luminance in a row of the picture, cd/m^2.
fn grid_in_row(column: ptr<function, GridColumn>, y: u32) -> vec3<f32> {
    // This multiplication replaces an integer division, which CPUs compute one lane at a time. It is exact, since the value is half a step away from
    // the next integer.
    let grid_row = (f32(y) + 0.5) / f32((*column).grid.spacing);
    let above = floor(grid_row);
    if above != (*column).held {
        (*column).held = above;
        (*column).top = between_points(*column, u32(above));
        (*column).bottom = between_points(*column, u32(above) + 1u);
    }
    return mix((*column).top, (*column).bottom, grid_row - above);
}
