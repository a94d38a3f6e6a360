// One triangle that covers the whole target; the scissor cuts out of it what is drawn.

@vertex
fn cover_target(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
