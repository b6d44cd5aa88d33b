// splats.wgsl: draws balls into the G-buffer, each as what the eye sees of it.
//
// Draw      one instance a splat, 4 vertices each (a triangle strip).
// Reads     params; the instance's `SplatDraw`.
// Writes    albedo (sRGB; alpha 1), normal (world; w = largest distance between two of its pixels), depth (the bits of z, world
//           units), depth test (near / z: 1 at the near plane, 0 at infinity).
// Limits    none beyond the baseline of WebGPU.
//
// With the eye at the origin, z the depth of a ball's centre c, d its distance, r the radius and f the focal length in
// pixels, the silhouette is an ellipse around f z c.xy / (z² - r²) whose longer half axis is f r √(d² - r²) / (z² - r²):
// half of `gigalod_geom::projected::diameter_px`. A round splat is exactly that ellipse, and a square one the square around
// it, so a surface point inside the ball is covered wherever it projects to.
//
// The depth is that of the ball's front. A ball that covers a surface point is therefore never drawn behind it.

#import splat_params.wgsl

@group(0) @binding(0) var<uniform> params: SplatParams;

struct Splat {
    @location(0) center_in_eye: vec3f,
    @location(1) radius: f32,
    @location(2) normal_color: u32,
}

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center_in_view: vec3f,
    @location(1) @interpolate(flat) radius: f32,
    @location(2) @interpolate(flat) albedo: vec3f,
    @location(3) @interpolate(flat) normal_diameter: vec4f,
}

// A splat is drawn this much larger than its ball, in pixels, so that the rounding of a coordinate opens no hole.
const SLACK_PX: f32 = 0.01;

@vertex
fn place(@builtin(vertex_index) corner: u32, splat: Splat) -> Corner {
    let c = vec3f(
        dot(splat.center_in_eye, params.right.xyz),
        dot(splat.center_in_eye, params.up.xyz),
        dot(splat.center_in_eye, params.forward.xyz),
    ) * params.world_from_model;
    let r = splat.radius * params.world_from_model;
    let offset = vec2f(f32(corner & 1u), f32(corner >> 1u)) * 2.0 - 1.0;

    var middle_ndc = vec2f(0.0);
    var half_ndc = vec2f(1.0);
    var diameter_px = max(params.size_px.x, params.size_px.y) * 2.0;
    // A ball that reaches the plane of the eye may show anywhere: then the whole picture is tried.
    if c.z > r {
        let gap = (c.z - r) * (c.z + r);
        let f = params.focal_px;
        let half_px = f * r * sqrt(max(dot(c, c) - r * r, 0.0)) / gap;
        let to_ndc = 2.0 / params.size_px;
        middle_ndc = f * c.z * c.xy / gap * to_ndc;
        half_ndc = (half_px + SLACK_PX) * to_ndc;
        // A square's diagonal is √2 times its side.
        let across_px = half_px * select(2.0, 2.828427, params.kernel == KERNEL_SQUARE);
        diameter_px = min(across_px, diameter_px);
    }

    var out: Corner;
    out.position = vec4f(middle_ndc + offset * half_ndc, 0.5, 1.0);
    out.center_in_view = c;
    out.radius = r;
    out.albedo = color_of(splat.normal_color >> 16u);
    let n = normal_of(splat.normal_color & 0x3fffu);
    out.normal_diameter = vec4f(params.model_x.xyz * n.x + params.model_y.xyz * n.y + params.model_z.xyz * n.z, diameter_px);
    return out;
}

struct Surface {
    @location(0) albedo: vec4f,
    @location(1) normal_diameter: vec4f,
    @location(2) depth_bits: u32,
    @builtin(frag_depth) depth_test: f32,
}

@fragment
fn cover(in: Corner) -> Surface {
    // The pixel's ray is (slope, 1) · depth; `aside` is where it passes the centre, at the centre's depth.
    let from_middle = in.position.xy - params.size_px * 0.5;
    let slope = vec2f(from_middle.x, -from_middle.y) / params.focal_px;
    let c = in.center_in_view;
    let aside = slope * c.z - c.xy;
    let stretch = 1.0 + dot(slope, slope);
    let along = dot(aside, slope);
    let apart_squared = dot(aside, aside) - along * along / stretch;
    let r = in.radius;
    let reach = r + SLACK_PX * abs(c.z) / params.focal_px;
    if params.kernel == KERNEL_ROUND && apart_squared > reach * reach {
        discard;
    }
    // Nearest point of the ball on the ray; outside the ball, in a square's corners, the depth of the nearest point to it.
    let half_chord = sqrt(max(r * r - apart_squared, 0.0) * stretch);
    let z = c.z - (along + half_chord) / stretch;
    // Behind the eye: the ray meets the ball only where it does not go.
    if c.z - (along - half_chord) / stretch <= params.near {
        discard;
    }

    var out: Surface;
    out.albedo = vec4f(in.albedo, 1.0);
    out.normal_diameter = in.normal_diameter;
    out.depth_bits = bitcast<u32>(max(z, params.near));
    out.depth_test = params.near / max(z, params.near);
    return out;
}

// Linear light of a 5-6-5 sRGB colour.
fn color_of(packed: u32) -> vec3f {
    let encoded = vec3f(f32(packed >> 11u) / 31.0, f32((packed >> 5u) & 63u) / 63.0, f32(packed & 31u) / 31.0);
    return select(pow((encoded + 0.055) / 1.055, vec3f(2.4)), encoded / 12.92, encoded <= vec3f(0.04045));
}

// Unit vector of a 14-bit normal; CPU twin: `gigalod_geom::quantise::normal::decode`.
fn normal_of(code: u32) -> vec3f {
    let face = code / 2704u;
    let slopes = tan(0.7853981634 * ((vec2f(f32(code % 52u), f32(code / 52u % 52u)) * 2.0 + 1.0) / 52.0 - 1.0));
    let sign = select(1.0, -1.0, (face & 1u) == 1u);
    switch face / 2u {
        case 0u: { return normalize(vec3f(sign, slopes.x, slopes.y)); }
        case 1u: { return normalize(vec3f(slopes.y, sign, slopes.x)); }
        default: { return normalize(vec3f(slopes.x, slopes.y, sign)); }
    }
}
