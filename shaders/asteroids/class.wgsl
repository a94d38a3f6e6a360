// Selects the form in which an asteroid is drawn, and tests whether a picture may show it. It does the same in f32 as
// crates/render/src/plan/asteroids/classes.rs and views.rs.

#import asteroids/instance
#import asteroids/shape
#import constants/asteroid_classes
#import constants/faces
#import shared/projection
#import structs/AsteroidView

// Classes. Values from 0 on are levels of detail.
const CLASS_NONE: u32 = 4294967295u;
const CLASS_IMPOSTOR: u32 = 4096u;
const CLASS_POINT: u32 = 4097u;

struct Classes {
    // The class that fades in, its share, and the previous class, which has the rest.
    current: u32,
    share: f32,
    before: u32,
}

// Returns the position relative to the eye in view axes, from the position relative to the camera in world axes.
fn view_from_camera(view: AsteroidView, place: vec3<f32>) -> vec3<f32> {
    let eye = vec3(view.view_from_world_x.w, view.view_from_world_y.w, view.view_from_world_z.w);
    let relative = place - eye;
    return vec3(
        dot(relative, view.view_from_world_x.xyz),
        dot(relative, view.view_from_world_y.xyz),
        dot(relative, view.view_from_world_z.xyz));
}

// Whether the picture may show a sphere.
fn touches(view: AsteroidView, middle: vec3<f32>, radius: f32) -> bool {
    if view.kind == VIEW_FLAT {
        let inside_x = vec2(dot(view.edges_x.xy, middle.xz), dot(view.edges_x.zw, middle.xz));
        let inside_y = vec2(dot(view.edges_y.xy, middle.yz), dot(view.edges_y.zw, middle.yz));
        return all(inside_x >= vec2(-radius)) && all(inside_y >= vec2(-radius));
    }
    return length(middle.xy) * view.cone_cosine + middle.z * view.cone_sine <= radius;
}

// Whether a face of the cube around the view axes may show a sphere.
fn touches_face(face: u32, middle: vec3<f32>, radius: f32) -> bool {
    var forwards = FACE_FORWARD;
    var ups = FACE_UP;
    let forward = forwards[face];
    let up = ups[face];
    let reach = dot(middle, forward) + radius * 1.41435;
    return reach >= abs(dot(middle, up)) && reach >= abs(dot(middle, cross(forward, up)));
}

// Returns the position of a direction in the tables.
fn table_place(view: AsteroidView, middle: vec3<f32>, distance: f32) -> f32 {
    let along = select(-middle.z, middle.y, view.kind == VIEW_LONGITUDE);
    return sqrt(clamp(0.5 * (1.0 - along / distance), 0.0, 1.0));
}

// Returns the angle of the shorter side of a pixel at a position in the table, rad.
fn pixel_at(view: AsteroidView, place: f32) -> f32 {
    let x = place * f32(TABLE_STEPS);
    let i = min(u32(x), TABLE_STEPS - 1u);
    let f = x - f32(i);
    return asteroid_tables[view.first_entry + i].x * (1.0 - f) + asteroid_tables[view.first_entry + i + 1u].x * f;
}

fn bend_beside(view: AsteroidView, place: f32) -> f32 {
    let i = min(u32(clamp(place, 0.0, 1.0) * f32(TABLE_STEPS)), TABLE_STEPS - 1u);
    return max(asteroid_tables[view.first_entry + i].y, asteroid_tables[view.first_entry + i + 1u].y);
}

// Whether the images of an asteroid's edges, `edge` mean radii long, depart from straight lines by more than half a pixel.
fn bends(view: AsteroidView, place: f32, edge: f32, bound: f32, radius: f32, distance: f32) -> bool {
    let size = bound * radius / distance;
    if size >= 0.5 {
        return true;
    }
    let bend = max(bend_beside(view, place), max(bend_beside(view, place - 0.53 * size), bend_beside(view, place + 0.53 * size)));
    let edge_rad = edge * radius / distance;
    return edge_rad * edge_rad * 0.125 * bend * view.quality > 0.5;
}

// Returns the distance at which impostors begin. `per_pixel`: quality divided by the angle of a pixel.
fn impostor_start(view: AsteroidView, bound: f32, per_pixel: f32) -> f32 {
    let disparity = sqrt(2.0 * view.impostor_eyes * bound * per_pixel);
    return max(max(disparity, view.impostor_linear * bound * per_pixel), bound * pow(per_pixel, view.impostor_exponent));
}

// Returns the classes of an asteroid.
fn classes_of(view: AsteroidView, shape: AsteroidShape, radius: f32, distance: f32, pixel: f32) -> Classes {
    var classes = Classes(0u, 1.0, CLASS_NONE);
    if view.finest_only != 0u {
        return classes;
    }
    let unit = view.quality * radius / pixel;
    let reach = impostor_start(view, shape.bound * radius, view.quality / pixel);
    let uses_impostor = view.impostor_linear >= 0.0 && reach * (1.0 + BAND) <= unit;
    let meshes_until = select(unit, reach, uses_impostor);
    var end = 0.0;
    for (var level = 1u; level < shape.levels; level++) {
        let start = max(2.0 * asteroid_tables[shape.first_level + level].x * unit, end);
        let stop = start * (1.0 + BAND);
        if stop > meshes_until || distance < start {
            break;
        }
        classes = taken(classes, level, start, stop, distance);
        end = stop;
    }
    if uses_impostor && distance >= reach {
        classes = taken(classes, CLASS_IMPOSTOR, reach, reach * (1.0 + BAND), distance);
    }
    if distance >= unit {
        classes = taken(classes, CLASS_POINT, unit, 2.0 * unit, distance);
    }
    return classes;
}

fn taken(before: Classes, current: u32, start: f32, stop: f32, distance: f32) -> Classes {
    if distance >= stop {
        return Classes(current, 1.0, CLASS_NONE);
    }
    return Classes(current, (distance - start) / (stop - start), before.current);
}
