// Light of eight pixels of a column, from the top: one channel in two vectors, so that a source is read once for all of them.
struct Light8 {
    red: array<vec4<f32>, 2>,
    green: array<vec4<f32>, 2>,
    blue: array<vec4<f32>, 2>,
}

fn add_light(light: ptr<function, Light8>, four: u32, colour: vec3<f32>, kernel: vec4<f32>) {
    (*light).red[four] += colour.x * kernel;
    (*light).green[four] += colour.y * kernel;
    (*light).blue[four] += colour.z * kernel;
}
