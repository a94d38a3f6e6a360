// A star as seen by a moving observer: position, Doppler factor, temperature and light. The formulas are explained in crates/sky/src/relativity.rs,
// and the table and its size in crates/render/src/plan/stars/travel.rs. A file that imports this one declares the table `colours`: colour, and in w
// the logarithm of the luminance, one entry per temperature step. The table starts at step 0; the steps below 0 follow at its end, in ascending
// order.

#import constants/shifted_temperatures
#import structs/CameraMotion

fn moves(camera_motion: CameraMotion) -> bool {
    return camera_motion.gamma_beta > 0.0;
}

// xyz: apparent position of a star whose position relative to the eye is `place` (not 0); its distance is scaled by the Doppler factor D. w: D.
fn apparent_place(camera_motion: CameraMotion, place: vec3<f32>) -> vec4<f32> {
    let distance = length(place);
    let along = dot(place, camera_motion.direction);
    let across = place - camera_motion.direction * along;
    // This is 1 + cos a. Behind the camera the sum would cancel, so sin^2 a / (1 - cos a) replaces it.
    let one_plus_cos = select(distance + along, dot(across, across) / (distance - along), along < 0.0) / distance;
    let seen_along = distance * (camera_motion.gamma * one_plus_cos - camera_motion.doppler_behind);
    return vec4(across + camera_motion.direction * seen_along,
        camera_motion.doppler_behind + camera_motion.gamma_beta * one_plus_cos);
}

// Returns the number of steps by which a Doppler factor shifts a temperature.
fn doppler_steps(doppler: f32) -> f32 {
    return STEPS_PER_OCTAVE * log2(doppler);
}

// Returns the index of a step in the table.
fn table_index(step: i32) -> u32 {
    let held = clamp(step, COLDEST_STEP, COLDEST_STEP + TABLE_STEPS - 1);
    return u32(select(held, held + TABLE_STEPS, held < 0));
}

// Returns the factor on the light of a star with the temperature step `step`: D^-2 Y(D T) / Y(T).
fn light_factor(step: u32, doppler: f32) -> f32 {
    let shifted = f32(step) + doppler_steps(doppler);
    let below = floor(shifted);
    let low = colours[table_index(i32(below))].w;
    let high = colours[table_index(i32(below) + 1)].w;
    return exp(low + (shifted - below) * (high - low) - colours[step].w) / (doppler * doppler);
}
