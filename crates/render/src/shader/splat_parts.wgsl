// Which part of the buffer a splat belongs to: the last that does not begin after it.

fn part_of_slot(slot: u32) -> u32 {
    var low = frame.first_part;
    var high = frame.first_part + frame.part_count;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if parts[middle].first_slot <= slot {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}
