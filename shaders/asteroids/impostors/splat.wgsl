// Splats impostors. Each thread of a workgroup computes the footprint of one impostor; then teams of eight threads process one footprint after the
// other, each thread some of its samples. Lanes first look for their next relevant sample and then read tiles together, because on a software driver
// all lanes execute the instructions of each lane.

#import asteroids/impostors/footprint
#import constants/impostors
#import samples = asteroids/impostors/samples_u32 | asteroids/impostors/samples_u64
#import task = asteroids/impostors/splat_nearest | asteroids/impostors/splat_light

@group(2) @binding(2) var<storage, read> arguments: array<u32>;
// Per plane, the number of impostors that are not visible. Then, for every entry of the list, whether any of its samples may be visible, and how its
// tile is read.
@group(2) @binding(3) var<storage, read_write> still_seen: array<atomic<u32>>;

override WORKGROUP: u32;

const NO_SAMPLE: u32 = 4294967295u;

// Flag: the entry owns a sample, according to the results so far.
const OWN: u32 = 1u;
// Flag: the entry's tile is read with parallax.
const NEEDS_PARALLAX: u32 = 2u;

var<workgroup> footprints: array<Footprint, SPLAT_THREADS>;
var<workgroup> indices: array<u32, SPLAT_THREADS>;
var<workgroup> taken: atomic<u32>;
// Flag OWN for each footprint.
var<workgroup> findings: array<atomic<u32>, SPLAT_THREADS>;

@compute @workgroup_size(WORKGROUP)
fn splat_impostors(
    @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&taken, 0u);
    }
    atomicStore(&findings[local], 0u);
    workgroupBarrier();
    let index = (group.y * groups.x + group.x) * WORKGROUP + local;
    if index < arguments[splat.arguments + 3u] && is_taken(atomicLoad(&still_seen[MAX_PLANES + index])) {
        let footprint = footprint_of(arguments[splat.arguments + 4u] + index);
        // The other threads use the stored decision of these threads, since two pipelines may round differently.
        let takes = PARALLAX || splat.stage > 0u || footprint.parallax == 0.0;
        if splat.stage == 0u && !PARALLAX {
            atomicStore(&still_seen[MAX_PLANES + index], select(NEEDS_PARALLAX, 0u, takes));
        }
        if takes && all(footprint.first < footprint.end) {
            let k = atomicAdd(&taken, 1u);
            footprints[k] = footprint;
            indices[k] = index;
        }
    }
    workgroupBarrier();
    let count = atomicLoad(&taken);
    // With a single team, the footprint index is uniform. The driver must be able to detect this.
    for (var k = select(local / SPLAT_LANES, 0u, WORKGROUP == SPLAT_LANES); k < count; k += WORKGROUP / SPLAT_LANES) {
        let finding = process_samples(k, i32(local % SPLAT_LANES));
        if finding != 0u {
            atomicOr(&findings[k], finding);
        }
    }
    workgroupBarrier();
    if local < count {
        let finding = atomicLoad(&findings[local]);
        if splat.stage == 0u {
            atomicStore(&still_seen[MAX_PLANES + indices[local]], (finding & OWN) | select(0u, NEEDS_PARALLAX, PARALLAX));
        }
        // Each impostor is counted once, in the band of its centre, and independently of thread order. Impostors that never owned a sample are
        // counted, and those that own none in the end.
        let row = footprints[local].middle.y - f32(splat.band.first_row);
        if splat.stage != 1u && (finding & OWN) == 0u && row >= 0.0 && row < f32(splat.band.rows) {
            atomicAdd(&still_seen[asteroid_target.plane], 1u);
        }
    }
}

// Whether these threads process an entry, according to its flags.
fn is_taken(known: u32) -> bool {
    if splat.stage == 0u {
        return !PARALLAX || known == NEEDS_PARALLAX;
    }
    return known == select(OWN, OWN | NEEDS_PARALLAX, PARALLAX);
}

// Processes every eighth sample of a footprint.
fn process_samples(k: u32, lane: i32) -> u32 {
    let footprint = footprints[k];
    let width = footprint.end.x - footprint.first.x;
    let area = width * (footprint.end.y - footprint.first.y);
    let per_width = 1.0 / f32(width);
    var finding = 0u;
    var i = lane;
    loop {
        var found = NO_SAMPLE;
        var position = vec2(0);
        var place = vec2(0.0);
        while i < area {
            let y = i32((f32(i) + 0.5) * per_width);
            position = footprint.first + vec2(i - y * width, y);
            i += i32(SPLAT_LANES);
            place = place_on_square(footprint, position);
            if dot(place, place) <= 1.0 {
                let candidate = place_in_blocks(vec2<u32>(position - vec2(0, i32(splat.band.first_row))), splat.band.blocks);
                if may_be_own(footprint, candidate) {
                    found = candidate;
                    break;
                }
            }
        }
        if found == NO_SAMPLE {
            break;
        }
        finding |= select(0u, OWN, process_sample(footprint, found, position, place));
    }
    return finding;
}
