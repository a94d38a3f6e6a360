// The light that the kernel of a level scatters from cells towards a point. It is added to the light of the coarser level.

#import glare/sky_cube/cells
#import structs/GlareCell
#import structs/GlareLevelParameters

@group(0) @binding(0) var<uniform> parameters: GlareLevelParameters;
// Kernel, 1/sr, as a function of the squared chord.
@group(0) @binding(2) var<storage, read> kernel_table: array<f32>;
// The coarser level, sharpened, with a rim of one point.
@group(0) @binding(3) var<storage, read> map: array<vec4<f32>>;

// Returns the kernel at squared chords.
fn weights(squared: vec4<f32>) -> vec4<f32> {
    let place = min(squared, vec4(parameters.end_squared)) * parameters.entries;
    let entry = vec4<u32>(place);
    let low = vec4(kernel_table[entry.x], kernel_table[entry.y], kernel_table[entry.z], kernel_table[entry.w]);
    let next = entry + 1u;
    let high = vec4(kernel_table[next.x], kernel_table[next.y], kernel_table[next.z], kernel_table[next.w]);
    let within = mix(low, high, place - vec4<f32>(entry));
    return select(vec4(0.0), within, squared < vec4(parameters.end_squared));
}

fn light_of(index: u32, cell: GlareCell) -> vec3<f32> {
    return cell.light;
}

fn light_before(own: u32, direction: vec3<f32>) -> vec3<f32> {
    if parameters.coarser_cells > 0u {
        return read_map(0u, parameters.coarser_cells, direction);
    }
    return vec3(0.0);
}
