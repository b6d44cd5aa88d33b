// What is nearest in each pixel of the band, and which splat it is: one word of 64 bits, so that both change at once.
// High: nearness, low: the inverted number, so that of equally near splats the first in the list wins. 0: nothing.
@group(0) @binding(4) var<storage, read_write> keys: array<atomic<u64>>;

// True where a read costs less than what it saves.
override reads_first: bool = true;

fn deliver(at: u32, meeting: Meeting, splat: Splat) {
    let key = (u64(nearness_of(meeting.z)) << 32u) | u64(~splat.number);
    // A read turns away most of what is hidden, and is cheaper than an atomic maximum: but not everywhere.
    if !reads_first || atomicLoad(&keys[at]) < key {
        atomicMax(&keys[at], key);
    }
}
