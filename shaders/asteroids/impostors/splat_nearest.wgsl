// What is nearest to the eye, whatever the order of threads. Entries come from near to far, so most of what is hidden is found so by one
// comparison.

#import asteroids/impostors/footprint

// Whether a sample may be its own.
fn may_be_own(footprint: Footprint, sample_at: u32) -> bool {
    return depth_there(sample_at) <= footprint.nearest;
}

fn work_on(footprint: Footprint, sample_at: u32, at: vec2<i32>, place: vec2<f32>) -> bool {
    let offset = place.x * footprint.square.right + place.y * footprint.square.up;
    let on_square = footprint.centre + offset;
    let ray = normalize(on_square);
    let seen = form_at(footprint, place, ray, offset);
    if seen.coverage < 0.5 || faded(footprint.asteroid.fade, vec2<u32>(at)) {
        return false;
    }
    let depth = bitcast<u32>(depth_of_place((on_square + seen.beyond * ray) * footprint.radius));
    return claim(sample_at, depth, footprint.slot, splat.stage);
}
