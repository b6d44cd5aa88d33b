// What is nearest in each pixel of the band, and which splat it is: two words, found in two phases.
// Second: nearness. First: the inverted number, so that of equally near splats the first in the list wins. 0: nothing.
@group(0) @binding(4) var<storage, read_write> keys: array<atomic<u32>>;

fn deliver(at: u32, meeting: Meeting, splat: Splat) {
    let nearness = nearness_of(meeting.z);
    // Most of what is hidden is turned away by a read.
    let nearest = atomicLoad(&keys[at * 2u + 1u]);
    if frame.phase == 0u {
        if nearest < nearness {
            atomicMax(&keys[at * 2u + 1u], nearness);
        }
    } else if nearest == nearness {
        atomicMax(&keys[at * 2u], ~splat.number);
    }
}
