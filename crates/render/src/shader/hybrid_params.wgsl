// Inputs of all hybrid passes. Host twin: `HybridParams` in hybrid/params.rs; a test compares them.

// One pass over one slice of runs, into one band of rows of the picture.
struct HybridParams {
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
    // 0: what is nearest. 1: what it is.
    phase: u32,
    // What is wider or higher than this goes to the list.
    compute_extent_px: u32,
    // First run of the slice.
    first_run: u32,
    // Runs of triangles come first, then those of points, then those of lines.
    first_point_run: u32,
    first_line_run: u32,
    // Added to the ranks of pixels, so that those of a pixel's samples differ.
    turn: u32,
    pad: u32,
}
