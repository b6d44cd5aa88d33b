// Inputs of all splat passes. Host twins: `PassParams` and `PartParams` in splats/params.rs; a test compares them.

// One pass over one buffer of splats, into one band of rows of the picture.
struct PassParams {
    size_px: vec2f,
    // Where in the picture the view axis meets it.
    middle_px: vec2f,
    // Pixels covered by one unit of length seen from one unit away, and the inverse.
    focal_px: f32,
    per_focal_px: f32,
    // World units.
    near: f32,
    // The band: rows from the top.
    first_row: u32,
    end_row: u32,
    // 0: what is nearest. 1: what it is, or what is close to it.
    phase: u32,
    // Splats whose window is wider or higher than this are drawn through the pipeline.
    compute_extent_px: u32,
    // Which of the parts lie in this buffer of splats.
    first_part: u32,
    part_count: u32,
    // 1: extents of splats are wanted too.
    wants_footprint: u32,
    // Splats in this buffer.
    chunk_count: u32,
    pad: u32,
}

// Consecutive splats of one instance in one buffer.
struct PartParams {
    // View axes, in the model's axes, times the length of a model unit in world units.
    right: vec4f,
    up: vec4f,
    forward: vec4f,
    // The model's axes, in world axes.
    model_x: vec4f,
    model_y: vec4f,
    model_z: vec4f,
    // Number in the frame of its first splat, and where in the buffer that lies.
    first_number: u32,
    first_slot: u32,
    count: u32,
    // World units in a model unit. The size makes 256 bytes: parts also lie in a uniform buffer, at dynamic offsets.
    @size(148) world_from_model: f32,
}
