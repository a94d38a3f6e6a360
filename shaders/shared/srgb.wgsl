// The transfer function of sRGB. The f64 twin is src/photometry/tone_map.rs.

fn srgb_from_linear(value: vec3<f32>) -> vec3<f32> {
    let x = clamp(value, vec3(0.0), vec3(1.0));
    return select(1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3(0.0031308));
}

fn linear_from_srgb(value: vec3<f32>) -> vec3<f32> {
    return select(pow((value + 0.055) / 1.055, vec3(2.4)), value / 12.92, value <= vec3(0.04045));
}
