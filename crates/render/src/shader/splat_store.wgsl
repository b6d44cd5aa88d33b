// Splats on the device: textures, because all devices read them fast, whichever way invocations lie. Host twin: splats/store.rs.
@group(0) @binding(2) var balls: texture_2d<f32>;
@group(0) @binding(3) var normal_colors: texture_2d<u32>;

// Splats in a row of the textures, as a power of two.
const STORE_WIDTH_LOG2: u32 = 12u;

fn texel_of(slot: u32) -> vec2u {
    return vec2u(slot & ((1u << STORE_WIDTH_LOG2) - 1u), slot >> STORE_WIDTH_LOG2);
}

// Centre relative to the eye, and radius; the model's axes and units.
fn ball_at(slot: u32) -> vec4f {
    return textureLoad(balls, texel_of(slot), 0);
}

// Normal (14 bits, lowest) and colour (5-6-5, highest 16 bits).
fn normal_color_at(slot: u32) -> u32 {
    return textureLoad(normal_colors, texel_of(slot), 0).x;
}
