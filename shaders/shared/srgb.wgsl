// sRGB transfer functions: powers as polynomials in roots, accurate to 4e-7. A root is one instruction on CPUs and GPUs, while `pow` consists of a
// logarithm and an exponential. The polynomials are minimax fits around the middle of their range, so that rounding does not add to their error. The
// f64 twin, with powers, is crates/sky/src/photometry/tone_map.rs.

fn srgb_from_linear(value: vec3<f32>) -> vec3<f32> {
    let x = clamp(value, vec3(0.0), vec3(1.0));
    // 1.055 x^(1/2.4) - 0.055 = 1.055 q^(5/3) - 0.055 with q = x^(1/4).
    let t = sqrt(sqrt(x)) - 0.62;
    let high = ((-0.0762105497 * t + 0.0639605957) * t - 0.0452793828) * t + 0.0642803010;
    let upper = (((high * t - 0.1234159466) * t + 0.6874173911) * t + 1.2784883379) * t + 0.4205961734;
    return select(min(upper, vec3(1.0)), 12.92 * x, x <= vec3(0.0031308));
}

// Returns the inverse function for values from 0 to 1.
fn linear_from_srgb(value: vec3<f32>) -> vec3<f32> {
    // u^2.4 = u^2 s^(4/5) with s = u^(1/2).
    let u = value * (1.0 / 1.055) + 0.055 / 1.055;
    let t = sqrt(max(u, vec3(0.0))) - 0.65;
    let high = ((0.1398409045 * t - 0.1075248951) * t + 0.0623659428) * t - 0.0670412579;
    let power = (((high * t + 0.0828226374) * t - 0.1342231884) * t + 0.8719785043) * t + 0.7084853256;
    return select(u * u * power, value * (1.0 / 12.92), value <= vec3(0.04045));
}

// The same functions for display images within a budget of errors. They are wrong by at most a fiftieth of a code of 8 bits, and take half the time on
// a CPU. Both are exact at 1, so that white stays white.

fn short_srgb_from_linear(value: vec3<f32>) -> vec3<f32> {
    let x = clamp(value, vec3(0.0), vec3(1.0));
    // As a function of x^(1/2).
    let t = sqrt(x) - 0.5;
    let high = ((1.74676601 * t - 1.11698994) * t - 0.11360731) * t + 0.027592891;
    let upper = (((high * t + 0.148553356) * t - 0.173217885) * t + 0.986400199) * t + 0.537167233;
    return select(min(upper, vec3(1.0)), 12.92 * x, x <= vec3(0.0031308));
}

// Returns the inverse function for values from 0 to 1. An error counts as that of the code that `short_srgb_from_linear` returns for it.
fn short_linear_from_srgb(value: vec3<f32>) -> vec3<f32> {
    let t = value - 0.5;
    let high = (0.0829397617 * t - 0.091522941) * t + 0.271177159;
    let upper = ((high * t + 1.1685578) * t + 0.926101158) * t + 0.214041141;
    return select(upper, value * (1.0 / 12.92), value <= vec3(0.04045));
}
