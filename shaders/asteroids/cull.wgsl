// Culls asteroids and selects their level of detail: processes every asteroid of every group that may contain more than points, for all planes at
// once. A workgroup takes a group and loops over the planes linked to it. The shader runs twice. The first run counts the entries of the group per
// plane and kind of list. Then asteroids/cull_offsets.wgsl turns the counts into offsets, and the second run writes the entries. Offsets follow from
// counts in the order of groups and asteroids, so the lists are reproducible. The twin is crates/render/src/plan/asteroids/cpu_cull.rs.

#import asteroids/class
#import asteroids/instance
#import asteroids/lists
#import constants/asteroid_classes
#import constants/asteroid_culling
#import constants/asteroid_instances
#import constants/asteroid_lists
#import constants/frame_lists
#import structs/AsteroidLink

@group(0) @binding(0) var<uniform> parameters: AsteroidCullParameters;
@group(0) @binding(1) var<uniform> views: array<AsteroidView, MAX_VIEWPORTS>;
// Tables of pictures and shapes.
@group(0) @binding(2) var<storage, read> asteroid_tables: array<vec2<f32>>;
@group(0) @binding(3) var<uniform> planes: array<AsteroidPlane, MAX_PLANES>;
@group(0) @binding(4) var<storage, read> links: array<AsteroidLink>;
@group(0) @binding(5) var<storage, read> items: array<AsteroidItem>;
@group(0) @binding(6) var<storage, read_write> counts: array<u32>;
@group(1) @binding(0) var<storage, read> instances: array<u32>;
@group(1) @binding(1) var<uniform> fields: array<AsteroidField, MAX_FIELDS>;
@group(1) @binding(2) var<storage, read_write> entries: array<AsteroidEntry>;
@group(1) @binding(3) var<storage, read> bases: array<u32>;

override WORKGROUP: u32;
// Whether this is the second run.
override WRITES: bool = false;

const NOWHERE: u32 = 4294967295u;

var<workgroup> local_counts: array<atomic<u32>, MAX_LOCAL>;
// Result for the first eye, for each asteroid: local kinds of its one or two lists, 16 bits each, and its share of the first list.
var<workgroup> class_kinds: array<u32, GROUP>;
var<workgroup> class_fades: array<f32, GROUP>;
// The same for the current plane (NOWHERE: not drawn); number of the asteroid's entries in each list; offset of its first entry in each list.
var<workgroup> local_kinds: array<u32, GROUP>;
var<workgroup> local_fades: array<f32, GROUP>;
var<workgroup> local_copies: array<u32, GROUP>;
var<workgroup> local_places: array<vec2<u32>, GROUP>;
// Whether the two eyes see different asteroids.
var<workgroup> differs: atomic<u32>;

// Lists of one plane that contain an asteroid.
struct ListMembership {
    seen: bool,
    // Local kinds of its lists, 16 bits each; 65535: no list.
    kinds: u32,
    // Share of the first list; WHOLE if there is no second one.
    fade: f32,
    twice: bool,
}

fn kind_of(class_number: u32, shape: AsteroidShape, field: AsteroidField) -> u32 {
    if class_number == CLASS_IMPOSTOR {
        return field.kinds;
    }
    if class_number >= CLASS_IMPOSTOR {
        return 65535u;
    }
    return shape.first_kind + class_number - field.first_kind;
}

// Returns the longest edge of the drawn shape, mean radii. The diagonal of an impostor's square does not count, since it is not part of the outline.
fn edge_of(class_number: u32, shape: AsteroidShape) -> f32 {
    if class_number >= CLASS_IMPOSTOR {
        return 2.0 * shape.bound;
    }
    return asteroid_tables[shape.first_level + class_number].y;
}

// Returns the centre of an asteroid relative to the eye, view axes.
fn middle_of(index: u32, item: AsteroidItem, field: AsteroidField, view: AsteroidView) -> vec3<f32> {
    let word = INSTANCE_WORDS * (item.first + index);
    let offset = bitcast<vec3<f32>>(vec3(instances[word], instances[word + 1u], instances[word + 2u]));
    return view_from_camera(view, place_of(item, field, offset));
}

// Finds the lists of a plane that contain an asteroid. With `all`, kinds are computed even if the picture does not show
// it.
fn find_lists(
    index: u32, item: AsteroidItem, field: AsteroidField, view: AsteroidView, plane: AsteroidPlane, link: AsteroidLink, all: bool) -> ListMembership {
    var found = ListMembership(false, NOWHERE, WHOLE, false);
    let radius_and_shape = instances[INSTANCE_WORDS * (item.first + index) + 3u];
    let shape = asteroid_shape(shape_of(field, radius_and_shape));
    let radius = radius_of(field, radius_and_shape);
    let middle = middle_of(index, item, field, view);
    let bound = shape.bound * radius;
    let distance = length(middle);
    let seen = touches(view, middle, bound);
    if !(seen || all) || !(distance > 0.0) || !(radius > 0.0) {
        return found;
    }
    let place = table_place(view, middle, distance);
    let classes = classes_of(view, shape, radius, distance, pixel_at(view, place));
    var through_faces = false;
    if link.faces != 0u {
        var edge = edge_of(classes.current, shape);
        if classes.before != CLASS_NONE {
            edge = max(edge, edge_of(classes.before, shape));
        }
        through_faces = bends(view, place, edge, shape.bound, radius, distance);
    }
    found.seen = seen && plane.face == WHOLE_PICTURE;
    if through_faces == (plane.face == WHOLE_PICTURE) {
        return found;
    }
    if plane.face != WHOLE_PICTURE && !touches_face(plane.face, middle, bound) {
        return found;
    }
    found.kinds = kind_of(classes.current, shape, field) | 0xffff0000u;
    if classes.before != CLASS_NONE {
        // The value is never 0, since 0 has no sign.
        found.fade = max(classes.share, LEAST_SHARE);
        found.kinds = (found.kinds & 65535u) | (kind_of(classes.before, shape, field) << 16u);
    }
    found.twice = view.kind == VIEW_LONGITUDE && plane.face == WHOLE_PICTURE && abs(middle.x) <= bound && middle.z > -bound;
    return found;
}

@compute @workgroup_size(WORKGROUP)
fn cull(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let item_index = group.y * parameters.row + group.x;
    if item_index >= parameters.items {
        return;
    }
    let item = items[item_index];
    let field = fields[item.field];
    let local_kind_count = field.kinds + 2u;
    // View whose classes are stored.
    var classes_of_view = NOWHERE;
    for (var l = 0u; l < item.link_count; l++) {
        let link = links[item.first_link + l];
        let plane = planes[link.plane];
        let view = views[plane.view];
        for (var k = local; k < local_kind_count; k += WORKGROUP) {
            atomicStore(&local_counts[k], 0u);
        }
        if local == 0u {
            atomicStore(&differs, 0u);
        }
        workgroupBarrier();
        // Both eyes of a pair see an asteroid in the same class, from nearly the same distance, so the class is
        // computed once.
        let follows = view.class_view == classes_of_view;
        let first_of_pair = item.link_count > l + 1u && views[planes[links[item.first_link + l + 1u].plane].view].class_view == plane.view
            && planes[links[item.first_link + l + 1u].plane].view != plane.view;
        for (var i = local; i < item.count; i += WORKGROUP) {
            var found = ListMembership(false, NOWHERE, WHOLE, false);
            if follows {
                let radius_and_shape = instances[INSTANCE_WORDS * (item.first + i) + 3u];
                let bound = bound_of_shape(shape_of(field, radius_and_shape)) * radius_of(field, radius_and_shape);
                found.seen = touches(view, middle_of(i, item, field, view), bound);
                if found.seen {
                    found.kinds = class_kinds[i];
                    found.fade = class_fades[i];
                }
                if WRITES && found.kinds != local_kinds[i] {
                    atomicStore(&differs, 1u);
                }
            } else {
                found = find_lists(i, item, field, view, plane, link, first_of_pair);
                if first_of_pair {
                    class_kinds[i] = found.kinds;
                    class_fades[i] = found.fade;
                    if !found.seen {
                        found.kinds = NOWHERE;
                    }
                }
            }
            let copies = select(1u, 2u, found.twice);
            if WRITES {
                local_kinds[i] = found.kinds;
                local_fades[i] = found.fade;
                local_copies[i] = copies;
            } else {
                if (found.kinds & 65535u) != 65535u {
                    atomicAdd(&local_counts[found.kinds & 65535u], copies);
                }
                if (found.kinds >> 16u) != 65535u {
                    atomicAdd(&local_counts[found.kinds >> 16u], copies);
                }
                if found.seen {
                    atomicAdd(&local_counts[field.kinds + 1u], 1u);
                }
            }
        }
        classes_of_view = select(NOWHERE, plane.view, first_of_pair);
        workgroupBarrier();
        if WRITES {
            // One thread assigns offsets in the order of the asteroids. Usually both eyes have the same offsets.
            if local == 0u && !(follows && atomicLoad(&differs) == 0u) {
                for (var i = 0u; i < item.count; i++) {
                    let kinds = local_kinds[i];
                    let copies = local_copies[i];
                    var places = vec2(0u);
                    if (kinds & 65535u) != 65535u {
                        places.x = atomicAdd(&local_counts[kinds & 65535u], copies);
                    }
                    if (kinds >> 16u) != 65535u {
                        places.y = atomicAdd(&local_counts[kinds >> 16u], copies);
                    }
                    local_places[i] = places;
                }
            }
            workgroupBarrier();
            for (var i = local; i < item.count; i += WORKGROUP) {
                let kinds = local_kinds[i];
                if kinds == NOWHERE {
                    continue;
                }
                // The class that fades in has its share; the previous class has the rest.
                let share = local_fades[i];
                for (var side = 0u; side < 2u; side++) {
                    let kind = select(kinds & 65535u, kinds >> 16u, side == 1u);
                    if kind == 65535u {
                        continue;
                    }
                    let global_kind = select(field.first_kind + kind, field.impostor_kind, kind == field.kinds);
                    let column = plane.first_count + global_kind * plane.columns + link.column;
                    var slot = bases[link.plane * parameters.kinds + global_kind] + counts[column]
                        + select(local_places[i].x, local_places[i].y, side == 1u);
                    let fade = select(share, -share, side == 1u);
                    // Entries that do not fit are dropped here. The counts reveal this, and the frame fails with an error.
                    if slot < parameters.capacity {
                        entries[slot] = AsteroidEntry(item.first + i, item_index, fade);
                    }
                    if local_copies[i] > 1u && slot + 1u < parameters.capacity {
                        entries[slot + 1u] = AsteroidEntry(item.first + i, item_index | SEAM_BIT, fade);
                    }
                }
            }
        } else {
            for (var k = local; k < local_kind_count; k += WORKGROUP) {
                var global_kind = field.first_kind + k;
                if k == field.kinds {
                    global_kind = field.impostor_kind;
                } else if k > field.kinds {
                    global_kind = parameters.kinds - 1u;
                }
                counts[plane.first_count + global_kind * plane.columns + link.column] = atomicLoad(&local_counts[k]);
            }
        }
        workgroupBarrier();
    }
}
