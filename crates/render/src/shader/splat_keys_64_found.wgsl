// As splat_keys_64.wgsl, after some splats have been drawn: what lies behind those is turned away by a look at a texture.
@group(0) @binding(4) var<storage, read_write> keys: array<atomic<u64>>;
// What was there before this pass: inverted number, nearness; in rows as long as those of the store.
@group(0) @binding(9) var found: texture_2d<u32>;

// True where a read costs less than what it saves.
override reads_first: bool = true;

fn deliver(at: u32, meeting: Meeting, splat: Splat) {
    let nearness = nearness_of(meeting.z);
    let before = textureLoad(found, texel_of(at), 0).xy;
    if before.y > nearness || (before.y == nearness && before.x >= ~splat.number) {
        return;
    }
    let key = (u64(nearness) << 32u) | u64(~splat.number);
    if !reads_first || atomicLoad(&keys[at]) < key {
        atomicMax(&keys[at], key);
    }
}
