// Computes the start of every list and the arguments of its draw, in one workgroup. A list that would end beyond the capacity is drawn empty. This
// can be seen from totals[0], the total length of all lists.

#import asteroids/lists
#import constants/asteroid_lists

@group(0) @binding(0) var<uniform> parameters: AsteroidCullParameters;
@group(0) @binding(1) var<storage, read_write> totals: array<u32>;
// Per mesh: number of indices, first index, first vertex.
@group(0) @binding(2) var<storage, read> meshes: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> bases: array<u32>;
// Five words per list. For impostors drawn as squares, the first four words are those of a non-indexed draw. For splatted impostors, they are the
// workgroups along x, y and z, the number of entries, and the first entry.
@group(0) @binding(4) var<storage, read_write> arguments: array<u32>;

const PLACE_THREADS: u32 = 64u;
var<workgroup> sums: array<u32, PLACE_THREADS>;

// Returns the number of entries of a list. The last kind of a plane is only a count.
fn entries_of(bucket: u32) -> u32 {
    return select(totals[1u + bucket], 0u, bucket % parameters.kinds == parameters.kinds - 1u);
}

@compute @workgroup_size(PLACE_THREADS)
fn place_lists(@builtin(local_invocation_index) local: u32) {
    let run = (parameters.buckets + PLACE_THREADS - 1u) / PLACE_THREADS;
    let begin = min(local * run, parameters.buckets);
    let end = min(begin + run, parameters.buckets);
    var sum = 0u;
    for (var i = begin; i < end; i++) {
        sum += entries_of(i);
    }
    sums[local] = sum;
    workgroupBarrier();
    var place = 0u;
    for (var i = 0u; i < local; i++) {
        place += sums[i];
    }
    for (var i = begin; i < end; i++) {
        let count = entries_of(i);
        bases[i] = place;
        place += count;
        let drawn = select(0u, count, place <= parameters.capacity);
        let kind = i % parameters.kinds;
        var first = vec4(IMPOSTOR_VERTICES, 0u, 0u, 0u);
        if kind < parameters.mesh_kinds {
            first = meshes[kind];
        }
        arguments[5u * i] = first.x;
        arguments[5u * i + 1u] = drawn;
        // Indexed draws: first index and first vertex. Other draws: first vertex and first instance, which are 0.
        arguments[5u * i + 2u] = first.y;
        arguments[5u * i + 3u] = first.z;
        arguments[5u * i + 4u] = 0u;
        if parameters.splat_row > 0u && kind >= parameters.mesh_kinds {
            let groups = (drawn + parameters.splats_per_workgroup - 1u) / parameters.splats_per_workgroup;
            let columns = clamp(groups, 1u, parameters.splat_row);
            arguments[5u * i] = columns;
            arguments[5u * i + 1u] = (groups + columns - 1u) / columns;
            arguments[5u * i + 2u] = 1u;
            arguments[5u * i + 3u] = drawn;
            arguments[5u * i + 4u] = bases[i];
        }
    }
    if local == PLACE_THREADS - 1u {
        totals[0] = place;
    }
}
