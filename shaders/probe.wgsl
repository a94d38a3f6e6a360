// Evaluates the projection of one viewport at given points, to compare f32 on the adapter with f64.

#import constants/frame_lists
#import constants/workgroups
#import shared/projection
#import shared/viewport
#import structs/ProbeInput
#import structs/ProbeOutput

@group(0) @binding(0) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(1) var<storage, read> inputs: array<ProbeInput>;
@group(0) @binding(2) var<storage, read_write> outputs: array<ProbeOutput>;

@compute @workgroup_size(PROBE_THREADS)
fn probe(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&inputs) {
        return;
    }
    let viewport = viewports[0];
    let input = inputs[id.x];
    outputs[id.x].image = vec4(pixel_from_direction(viewport, input.direction), solid_angle(viewport, input.pixel));
    outputs[id.x].direction = direction_from_pixel(viewport, vec2<f32>(input.pixel) + 0.5);
}
