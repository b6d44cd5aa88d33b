// What is nearest in each pixel of the band, and in the second phase sums over all splats close behind it.
//
// Nearness: in the word after that of a number, as other kernels have it. Where a splat is at least half opaque the highest
// bit is set: what is only the hem of a splat never hides that.
// Sums: whole numbers, so that they do not depend on the order of splats. Ten words a pixel: weight; weight · albedo (3);
// weight · (normal + 1) / 2 (3); carries of the first four (8 bits each); carries of the normal (10 bits each); largest
// footprint. A splat adds less than 2²⁰ to a sum, so a million splats in a pixel are counted right.
@group(0) @binding(4) var<storage, read_write> keys: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> sums: array<atomic<u32>>;

// How far behind the nearest splat another still counts as the same surface, in nominal radii: one for the difference of
// front and rim of a ball, two for a surface at 45° over the distance at which two splats still overlap by half.
const SAME_SURFACE: f32 = 3.0;

fn deliver(at: u32, meeting: Meeting, splat: Splat) {
    let nearest = atomicLoad(&keys[at * 2u + 1u]);
    if frame.phase == 0u {
        let nearness = nearness_of(meeting.z) | select(0u, 0x80000000u, meeting.off_squared <= 1.0);
        if nearest < nearness {
            atomicMax(&keys[at * 2u + 1u], nearness);
        }
        return;
    }
    // Where there are only hems, all of them count: none is a surface that hides another.
    if (nearest & 0x80000000u) != 0u && meeting.z > depth_of(nearest) + SAME_SURFACE * splat.shape.reach {
        return;
    }
    // A spline from 1 in the middle over 1/2 at the nominal radius to 0 at twice that.
    let t = sqrt(meeting.off_squared) * 0.5;
    let weight = u32((1.0 - t * t * (3.0 - 2.0 * t)) * 256.0 + 0.5);
    let albedo = vec3u(splat.albedo * 4095.0 + 0.5) * weight;
    let normal = vec3u((splat.normal * 0.5 + 0.5) * 4095.0 + 0.5) * weight;
    let first = at * 10u;
    add(first, weight, first + 7u, 0u);
    add(first + 1u, albedo.x, first + 7u, 8u);
    add(first + 2u, albedo.y, first + 7u, 16u);
    add(first + 3u, albedo.z, first + 7u, 24u);
    add(first + 4u, normal.x, first + 8u, 0u);
    add(first + 5u, normal.y, first + 8u, 10u);
    add(first + 6u, normal.z, first + 8u, 20u);
    if frame.wants_footprint == 1u {
        atomicMax(&sums[first + 9u], bitcast<u32>(footprint_of(splat.shape)));
    }
}

fn add(at: u32, value: u32, carries: u32, shift: u32) {
    let before = atomicAdd(&sums[at], value);
    if before > 0xffffffffu - value {
        atomicAdd(&sums[carries], 1u << shift);
    }
}
