// splat_depth_test.wgsl: draws splats into the G-buffer by the depth test, for devices that cannot write storage (WebGL 2).
//
// Draw      one instance a splat of one part, 4 vertices each (a triangle strip).
// Reads     frame, part; balls, normals and colours.
// Writes    as splat_resolve.wgsl.
// Limits    none beyond WebGL 2. Cannot blend: no Gaussian kernels. Of splats that are equally near after rounding near / z the
//           first wins: now and then another than elsewhere.

#import splat_params.wgsl

@group(0) @binding(0) var<uniform> frame: PassParams;
@group(0) @binding(1) var<uniform> part: PartParams;

#import splat_store.wgsl
#import dot.wgsl
#import splat_shape.wgsl
#import splat_surface.wgsl

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_radius: vec4f,
    // middle_px, half_px, reach.
    @location(1) @interpolate(flat) silhouette: vec4f,
    // axis, stretch.
    @location(2) @interpolate(flat) ellipse: vec3f,
    @location(3) @interpolate(flat) albedo: vec3f,
    @location(4) @interpolate(flat) normal_footprint: vec4f,
}

@vertex
fn place(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Corner {
    let slot = part.first_slot + instance;
    let normal_color = normal_color_at(slot);
    let shape = shape_of(part, ball_at(slot), normal_color & 0x3fffu);
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
    out.albedo = color_of(normal_color >> 16u);
    out.normal_footprint = vec4f(normal_in_world(part, normal_color & 0x3fffu), footprint_of(shape));
    return out;
}

@fragment
fn cover(in: Corner) -> Surface {
    var shape: Shape;
    shape.center = in.center_radius.xyz;
    shape.radius = in.center_radius.w;
    shape.middle_px = in.silhouette.xy;
    shape.half_px = in.silhouette.z;
    shape.reach = in.silhouette.w;
    shape.axis = in.ellipse.xy;
    shape.stretch = in.ellipse.z;
    let meeting = meet(shape, vec2i(in.position.xy));
    if !meeting.covered {
        discard;
    }
    var out: Surface;
    out.albedo = vec4f(in.albedo, 1.0);
    out.normal_footprint = in.normal_footprint;
    out.depth_bits = bitcast<u32>(meeting.z);
    out.depth_test = frame.near * (1.0 / meeting.z);
    return out;
}
