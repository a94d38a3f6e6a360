// The lists that culling leaves, as the passes that make them and those that draw out of them know them. The same structs stand in
// src/gpu/layout.rs.

struct AsteroidCullParameters {
    items: u32,
    row: u32,
    kinds: u32,
    buckets: u32,
    capacity: u32,
    mesh_kinds: u32,
    // Workgroups along a row where impostors are splatted; 0: they are drawn.
    splat_row: u32,
    // Impostors per workgroup there.
    splats_per_workgroup: u32,
}

// A picture, or a face of the cube behind one.
struct AsteroidPlane {
    view: u32,
    face: u32,
    first_count: u32,
    columns: u32,
}

struct AsteroidEntry {
    instance: u32,
    item: u32,
    fade: f32,
}

