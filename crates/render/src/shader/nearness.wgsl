// Depths as whole numbers: the nearer, the larger; 0 stands for nothing at all. Depths are positive, so their bits are ordered
// as they are, and the highest bit is free.

fn nearness_of(z: f32) -> u32 {
    return 0x7fffffffu - bitcast<u32>(z);
}

fn depth_of(nearness: u32) -> f32 {
    return bitcast<f32>(0x7fffffffu - (nearness & 0x7fffffffu));
}
