// Functions whose built-in forms are too inaccurate on some drivers. The polynomials are those of the Cephes library for single precision, with
// errors of a few units in the last place.

#import constants/temperatures

const PI: f32 = 3.14159265358979;

// Returns the angle of the vector (x, y), both finite; 0 for the null vector.
fn precise_atan2(y: f32, x: f32) -> f32 {
    let ax = abs(x);
    let ay = abs(y);
    let largest = max(ax, ay);
    if largest == 0.0 {
        return 0.0;
    }
    let smallest = min(ax, ay);
    // Above tan(pi/8) the angle is measured from pi/4.
    let folded = smallest > 0.414213562 * largest;
    let t = select(smallest / largest, (smallest - largest) / (smallest + largest), folded);
    let z = t * t;
    let series = (((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z - 3.33329491539e-1) * z * t + t;
    var angle = series + select(0.0, 0.25 * PI, folded);
    angle = select(angle, 0.5 * PI - angle, ay > ax);
    angle = select(angle, PI - angle, x < 0.0);
    return select(angle, -angle, y < 0.0);
}

// sin(x) for 0 <= x <= pi/2. pi/2 is split into two parts, so that the difference keeps its precision.
fn sin_quarter(x: f32) -> f32 {
    let upper = x > 0.25 * PI;
    let u = select(x, (1.5703125 - x) + 4.83826794897e-4, upper);
    let z = u * u;
    let sine = ((-1.9515295891e-4 * z + 8.3321608736e-3) * z - 1.6666654611e-1) * z * u + u;
    let cosine = ((2.443315711809948e-5 * z - 1.388731625493765e-3) * z + 4.166664568298827e-2) * z * z - 0.5 * z + 1.0;
    return select(sine, cosine, upper);
}

// sin(x) for |x| <= pi.
fn precise_sin(x: f32) -> f32 {
    let ax = abs(x);
    let value = sin_quarter(select(ax, (3.140625 - ax) + 9.67653589793e-4, ax > 0.5 * PI));
    return select(value, -value, x < 0.0);
}

// cos(x) for |x| <= pi.
fn precise_cos(x: f32) -> f32 {
    return precise_sin((1.5703125 - abs(x)) + 4.83826794897e-4);
}

// Returns an integer hash with full avalanche (PCG by M. E. O'Neill, in the output form of Jarzynski and Olano 2020).
fn hash(value: u32) -> u32 {
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Returns the step of a temperature (K) on the scale, clamped to its range.
fn step_of_temperature(kelvin: f32) -> f32 {
    return clamp(log2(max(kelvin, 1.0) / COLDEST_K) * (LAST_STEP / TEMPERATURE_OCTAVES), 0.0, LAST_STEP);
}

// Returns the temperature of a step, K.
fn temperature_of_step(step: u32) -> f32 {
    return COLDEST_K * exp2(f32(step) * (TEMPERATURE_OCTAVES / LAST_STEP));
}
