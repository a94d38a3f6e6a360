// Light of eight pixels of a column, from the top. Each channel is stored in two vectors, so that one read of a source
// serves all pixels.
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
