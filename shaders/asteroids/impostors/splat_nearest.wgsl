// Finds the impostor nearest to the eye, independently of thread order. Entries are sorted from near to far, so one comparison rejects most hidden
// samples.

#import asteroids/impostors/footprint

// Whether the impostor may own a sample.
fn may_be_own(footprint: Footprint, sample_at: u32) -> bool {
    return depth_there(sample_at) <= footprint.nearest;
}

fn process_sample(footprint: Footprint, sample_at: u32, position: vec2<i32>, place: vec2<f32>) -> bool {
    let offset = place.x * footprint.square.right + place.y * footprint.square.up;
    let on_square = footprint.centre + offset;
    let ray = normalize(on_square);
    let seen = shape_at(footprint, place, ray, offset);
    if seen.coverage < 0.5 || faded(footprint.asteroid.fade, vec2<u32>(position)) {
        return false;
    }
    let depth = bitcast<u32>(depth_of_place((on_square + seen.beyond * ray) * footprint.radius));
    return claim(sample_at, depth, footprint.slot, splat.stage);
}
