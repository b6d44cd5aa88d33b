// A triangle on the screen, in whole steps: shared by the passes that draw triangles, so that they agree to the last bit.
//
// A pixel belongs to it where its centre lies inside, or on a left or top edge. Depth is 1 / z interpolated, which is exact for
// a plane, by weights that whole numbers give: so it lies between the depths of the corners, however thin a triangle is.

struct Flat {
    // Clockwise as seen: the second and third corner may have changed places.
    a: vec2i,
    b: vec2i,
    c: vec2i,
    // 1 / z of each.
    per_z: vec3f,
}

// Turns it so that its area is positive.
fn flat_of(a: Vertex, b: Vertex, c: Vertex, is_turned: bool) -> Flat {
    var out: Flat;
    out.a = a.at;
    out.b = select(b.at, c.at, is_turned);
    out.c = select(c.at, b.at, is_turned);
    out.per_z = vec3f(a.per_z, select(b.per_z, c.per_z, is_turned), select(c.per_z, b.per_z, is_turned));
    return out;
}

// True where what lies exactly on this edge of a triangle belongs to it.
fn owns(edge: vec2i) -> bool {
    return edge.y < 0i || (edge.y == 0i && edge.x > 0i);
}

// `shares`: twice the areas that a pixel's centre makes with the edges across from each corner, and `area` that of the triangle. A sum
// of what is positive: nothing cancels, however near one corner is and however far another.
fn depth_in(flat: Flat, shares: vec3f, area: f32) -> f32 {
    return area * (1.0 / dot3(shares, flat.per_z));
}
