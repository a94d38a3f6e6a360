// Splatting a point of light that is not a star. Needs viewport.wgsl, projection.wgsl, splat.wgsl with what that needs, and
// occlusion.wgsl.

// Splats light, lx, that comes from a unit direction in world axes and a distance, as far as it is seen.
fn splat_light(
    tile: Tile, viewport: Viewport, unit: vec3<f32>, light: vec3<f32>, distance_m: f32, units_per_lx: f32, number: u32) {
    let direction = vec3(
        dot(unit, viewport.view_from_world_x.xyz),
        dot(unit, viewport.view_from_world_y.xyz),
        dot(unit, viewport.view_from_world_z.xyz));
    let projected = pixel_from_direction(viewport, direction);
    let illuminance = dot(light, vec3(0.2126, 0.7152, 0.0722));
    let margin = select(1.5, viewport.gaussian_reach_px, illuminance >= viewport.gaussian_from_lx);
    let first_row = f32(tile.first_row);
    if !(illuminance > 0.0) || projected.z == 0.0 || any(projected.xy < vec2(0.0, first_row) - margin)
        || any(projected.xy > vec2(f32(viewport.size.x), first_row + f32(tile.rows)) + margin) {
        return;
    }
    let visible = visible_share(tile, viewport, direction, projected.xy, distance_m);
    if visible > 0.0 {
        let scale = illuminance * visible * units_per_lx;
        splat(tile, viewport, direction, projected.xy, illuminance, light / illuminance, scale, number);
    }
}
