// Splats impostors. The threads of a workgroup take one each and find out where it falls; then teams of eight go through the samples of one
// after the other. Lanes look for their next sample that matters before they read tiles together: a software driver's lanes all do what one
// of them does.

#import asteroids/impostors/footprint
#import constants/impostors
#import samples = asteroids/impostors/samples_u32 | asteroids/impostors/samples_u64
#import task = asteroids/impostors/splat_nearest | asteroids/impostors/splat_light

@group(2) @binding(2) var<storage, read> arguments: array<u32>;
// Per plane the impostors that are not seen; then of every entry of the list whether a sample of it may be
// seen, and what its tile is read with.
@group(2) @binding(3) var<storage, read_write> still_seen: array<atomic<u32>>;

override WORKGROUP: u32;

const MOST_THREADS: u32 = 64u;
const NO_SAMPLE: u32 = 4294967295u;

// A sample is the impostor's own, as far as is known.
const OWN: u32 = 1u;
// What is known of an entry besides: that its tile is read with parallax.
const NEEDS_PARALLAX: u32 = 2u;

var<workgroup> footprints: array<Footprint, MOST_THREADS>;
var<workgroup> indices: array<u32, MOST_THREADS>;
var<workgroup> taken: atomic<u32>;
// Of each footprint whether a sample is its OWN.
var<workgroup> findings: array<atomic<u32>, MOST_THREADS>;

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
        // What these threads decide first holds for all others: two pipelines may round otherwise.
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
    // A single team's footprint is the same for all threads, which a driver must be able to tell.
    for (var k = select(local / SPLAT_LANES, 0u, WORKGROUP == SPLAT_LANES); k < count; k += WORKGROUP / SPLAT_LANES) {
        let finding = go_through(k, i32(local % SPLAT_LANES));
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
        // Each is counted once, in the band that its middle is in, and the same whatever the order of threads: those that never had a sample,
        // and those that have none left in the end.
        let row = footprints[local].middle.y - f32(splat.band.first_row);
        if splat.stage != 1u && (finding & OWN) == 0u && row >= 0.0 && row < f32(splat.band.rows) {
            atomicAdd(&still_seen[asteroid_target.plane], 1u);
        }
    }
}

// Whether an entry is one of these threads', by what is known of it.
fn is_taken(known: u32) -> bool {
    if splat.stage == 0u {
        return !PARALLAX || known == NEEDS_PARALLAX;
    }
    return known == select(OWN, OWN | NEEDS_PARALLAX, PARALLAX);
}

// Every eighth sample of a footprint.
fn go_through(k: u32, lane: i32) -> u32 {
    let footprint = footprints[k];
    let width = footprint.end.x - footprint.first.x;
    let area = width * (footprint.end.y - footprint.first.y);
    let per_width = 1.0 / f32(width);
    var finding = 0u;
    var i = lane;
    loop {
        var found = NO_SAMPLE;
        var at = vec2(0);
        var place = vec2(0.0);
        while i < area {
            let y = i32((f32(i) + 0.5) * per_width);
            at = footprint.first + vec2(i - y * width, y);
            i += i32(SPLAT_LANES);
            place = place_on_square(footprint, at);
            if dot(place, place) <= 1.0 {
                let candidate = place_in_blocks(vec2<u32>(at - vec2(0, i32(splat.band.first_row))), splat.band.blocks);
                if may_be_own(footprint, candidate) {
                    found = candidate;
                    break;
                }
            }
        }
        if found == NO_SAMPLE {
            break;
        }
        finding |= select(0u, OWN, work_on(footprint, found, at, place));
    }
    return finding;
}
