// What is delivered to keys by splat_keys_64.wgsl and splat_keys_32.wgsl.

struct Meeting {
    // Depth, world units.
    z: f32,
}

struct Splat {
    // Of the primitive.
    number: u32,
}
