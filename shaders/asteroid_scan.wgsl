// Turns the counts of every list, group by group, into places within the list, and writes its total. A workgroup takes a list.
// Needs asteroid_lists.wgsl.

@group(0) @binding(0) var<uniform> parameters: AsteroidCullParameters;
@group(0) @binding(1) var<storage, read> planes: array<AsteroidPlane>;
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> totals: array<u32>;

const THREADS: u32 = 64u;
var<workgroup> sums: array<u32, THREADS>;

@compute @workgroup_size(THREADS)
fn scan(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let bucket = group.y * parameters.row + group.x;
    if bucket >= parameters.buckets {
        return;
    }
    let plane = planes[bucket / parameters.kinds];
    let first = plane.first_count + (bucket % parameters.kinds) * plane.columns;
    // Every thread takes a run of columns.
    let run = (plane.columns + THREADS - 1u) / THREADS;
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
    if local == THREADS - 1u {
        // Entry 0 is the length of all lists: asteroid_offsets.wgsl.
        totals[1u + bucket] = place;
    }
}
