// Glare sources that belong to one eye: near stars, bodies, asteroid fields. The importer binds `near`.

#import constants/extended_sources
#import glare/light8
#import glare/sky_cube/kernel
#import glare/sky_cube/sprites
#import structs/GlareNear

// Adds the light that the eye's own sources scatter towards eight pixels of a column.
fn add_near(light: ptr<function, Light8>, view: GlareView, directions: array<Directions4, 2>) {
    let first = vec3(directions[0].x.x, directions[0].y.x, directions[0].z.x);
    for (var i = view.first_near; i < view.first_near + view.near_count; i++) {
        let extended = (near[i].parts & IS_EXTENDED) != 0u;
        let parts = select(near[i].parts, 0u, extended);
        if parts > 0u {
            if length(first - near[i].direction) < near[i].reach {
                continue;
            }
        }
        let soft = select(near[i].reach, 0.0, parts > 0u);
        for (var four = 0u; four < 2u; four++) {
            let own = chords_squared(directions[four], near[i].direction);
            let squared = own + soft;
            var kernel = kernel_in_view(view, squared, angle_squared(squared));
            if extended {
                // The omitted share is drawn on the source itself, as a bump of twice its radius whose integral is 1.
                let inside = max(1.0 - own / (4.0 * soft), vec4(0.0));
                kernel += f32(near[i].parts & SHARE_PARTS) / f32(SHARE_PARTS) * 3.0 / (PI * 4.0 * soft) * inside * inside;
            }
            add_light(light, four, near[i].light, kernel);
        }
        i += parts;
    }
}
