// Turns the counts of every list, group by group, into offsets within the list, and writes its total. A workgroup takes
// a list.

#import asteroids/lists
#import constants/frame_lists

@group(0) @binding(0) var<uniform> parameters: AsteroidCullParameters;
@group(0) @binding(1) var<uniform> planes: array<AsteroidPlane, MAX_PLANES>;
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> totals: array<u32>;

const SCAN_THREADS: u32 = 64u;
var<workgroup> sums: array<u32, SCAN_THREADS>;

@compute @workgroup_size(SCAN_THREADS)
fn scan(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let bucket = group.y * parameters.row + group.x;
    if bucket >= parameters.buckets {
        return;
    }
    let plane = planes[bucket / parameters.kinds];
    let first = plane.first_count + (bucket % parameters.kinds) * plane.columns;
    // Each thread takes a run of columns.
    let run = (plane.columns + SCAN_THREADS - 1u) / SCAN_THREADS;
    let begin = min(local * run, plane.columns);
    let end = min(begin + run, plane.columns);
    var sum = 0u;
    for (var i = begin; i < end; i++) {
        sum += counts[first + i];
    }
    sums[local] = sum;
    workgroupBarrier();
    var place = 0u;
    for (var i = 0u; i < local; i++) {
        place += sums[i];
    }
    for (var i = begin; i < end; i++) {
        let count = counts[first + i];
        counts[first + i] = place;
        place += count;
    }
    if local == SCAN_THREADS - 1u {
        // Entry 0 is the length of all lists: asteroids/cull_offsets.wgsl.
        totals[1u + bucket] = place;
    }
}
