// splat_quads.wgsl: draws the large splats that splat_compute.wgsl has listed, each as the rectangle of its window.
//
// Draw      indirect: one instance a listed splat, 4 vertices each (a triangle strip).
// Reads     frame, parts; list; balls, normals and colours.
// Writes    keys (and sums) as splat_compute.wgsl does; nothing to its attachment.
// Limits    as for splat_compute.wgsl; storage is written by a fragment shader.

#import splat_params.wgsl

@group(0) @binding(0) var<uniform> frame: PassParams;
@group(0) @binding(6) var<storage, read> list: array<u32>;
@group(0) @binding(8) var<storage, read> parts: array<PartParams>;

#import splat_store.wgsl
#import dot.wgsl
#import splat_shape.wgsl
#import nearness.wgsl
#import splat_nearness.wgsl
#import splat_target.wgsl
#import splat_parts.wgsl

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_radius: vec4f,
    // middle_px, half_px, reach.
    @location(1) @interpolate(flat) silhouette: vec4f,
    // axis, stretch.
    @location(2) @interpolate(flat) ellipse: vec3f,
    @location(3) @interpolate(flat) albedo: vec3f,
    @location(4) @interpolate(flat) normal: vec3f,
    @location(5) @interpolate(flat) number: u32,
}

@vertex
fn place(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Corner {
    let slot = list[instance];
    let part = parts[part_of_slot(slot)];
    let splat = splat_of(part, ball_at(slot), normal_color_at(slot), part.first_number + (slot - part.first_slot));
    let shape = splat.shape;
    let at = vec2f(vec2i(
        select(shape.window.x, shape.window.z, (corner & 1u) == 1u),
        select(shape.window.y, shape.window.w, (corner >> 1u) == 1u),
    ));
    let ndc = at / frame.size_px * 2.0 - 1.0;

    var out: Corner;
    out.position = vec4f(ndc.x, -ndc.y, 0.5, 1.0);
    out.center_radius = vec4f(shape.center, shape.radius);
    out.silhouette = vec4f(shape.middle_px, shape.half_px, shape.reach);
    out.ellipse = vec3f(shape.axis, shape.stretch);
    out.albedo = splat.albedo;
    out.normal = splat.normal;
    out.number = splat.number;
    return out;
}

@fragment
fn cover(in: Corner) {
    var splat: Splat;
    splat.shape.center = in.center_radius.xyz;
    splat.shape.radius = in.center_radius.w;
    splat.shape.middle_px = in.silhouette.xy;
    splat.shape.half_px = in.silhouette.z;
    splat.shape.reach = in.silhouette.w;
    splat.shape.axis = in.ellipse.xy;
    splat.shape.stretch = in.ellipse.z;
    splat.number = in.number;
    splat.albedo = in.albedo;
    splat.normal = in.normal;
    let pixel = vec2i(in.position.xy);
    let meeting = meet(splat.shape, pixel);
    if meeting.covered {
        deliver(u32((pixel.y - i32(frame.first_row)) * i32(frame.size_px.x) + pixel.x), meeting, splat);
    }
}
