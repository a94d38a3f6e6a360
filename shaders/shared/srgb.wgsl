// The transfer function of sRGB: powers as polynomials in roots, within 7e-6 (0.0017 codes of 8 bits). A root is one instruction on CPUs and
// GPUs, while `pow` is a logarithm and an exponential. The f64 twin, with powers, is src/photometry/tone_map.rs.

fn srgb_from_linear(value: vec3<f32>) -> vec3<f32> {
    let x = clamp(value, vec3(0.0), vec3(1.0));
    // 1.055 x^(1/2.4) - 0.055 = 1.055 q^(5/3) - 0.055 with q = x^(1/4).
    let q = sqrt(sqrt(x));
    let upper = ((((-0.0681473420 * q + 0.2895330978) * q - 0.5774828134) * q + 1.2554044397) * q + 0.1620262643) * q - 0.0613402167;
    return select(min(upper, vec3(1.0)), 12.92 * x, x <= vec3(0.0031308));
}

// Of values from 0 to 1.
fn linear_from_srgb(value: vec3<f32>) -> vec3<f32> {
    // u^2.4 = u^2 s^(4/5) with s = u^(1/2).
    let u = value * (1.0 / 1.055) + 0.055 / 1.055;
    let s = sqrt(max(u, vec3(0.0)));
    let power = ((((0.0962876943 * s - 0.3996931068) * s + 0.7127609573) * s - 0.7744110472) * s + 1.3284585504) * s + 0.0366033583;
    return select(u * u * power, value * (1.0 / 12.92), value <= vec3(0.04045));
}
