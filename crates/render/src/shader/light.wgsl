// light.wgsl: lights the G-buffer.
//
// Draw      one triangle that covers the picture.
// Reads     params; albedo (alpha: how much of the pixel is there, the rest is background) and normal of the pixel.
// Writes    the picture, in linear light; the target encodes it as sRGB, or adds it up with others (smooth.wgsl).
// Limits    none beyond the baseline of WebGPU; depth textures are not loaded from, which OpenGL cannot.
//
// Lambert with an ambient share, from both sides: the normal is turned to the side that is seen. A normal that points away by
// less than GRAZING is left alone: there is no telling a back from a front whose smooth normal leans over the horizon, and
// fronts are what silhouettes are made of; turned, they would be lit from the wrong side.
// CPU twin: `gigalod_reference::shade`.

#import light_params.wgsl
#import dot.wgsl

@group(0) @binding(0) var<uniform> params: LightParams;
@group(0) @binding(1) var albedo_texture: texture_2d<f32>;
@group(0) @binding(2) var normal_texture: texture_2d<f32>;

// Sine of the angle beyond the horizon, about 14°. Chosen by eye, on the statue's nose; on open scans it costs up to 0.2 dB.
const GRAZING: f32 = 0.25;

@vertex
fn cover_picture(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn light(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(position.xy);
    let albedo = textureLoad(albedo_texture, pixel, 0);
    if albedo.a == 0.0 {
        return params.background * params.share;
    }
    let from_middle = position.xy - params.middle_px;
    let ray = params.forward.xyz + (params.right.xyz * from_middle.x - params.up.xyz * from_middle.y) * (1.0 / params.focal_px);
    let stored = textureLoad(normal_texture, pixel, 0).xyz;
    // Compared as squares: without roots.
    let along = dot3(stored, ray);
    let away = along > 0.0 && along * along > GRAZING * GRAZING * dot3(ray, ray) * dot3(stored, stored);
    // Where normals cancelled out, the surface faces the eye.
    let turned = select(stored, -stored, away);
    let faced = select(-ray, turned, dot3(turned, turned) > 1e-8);
    // Not `normalize`, which compilers spell in different ways, and round so.
    let normal = faced * inverseSqrt(dot3(faced, faced));
    let direct = (1.0 - params.ambient) * max(dot3(normal, params.towards_light.xyz), 0.0);
    let lit = albedo.rgb * params.light.rgb * (params.ambient + direct);
    return vec4f(params.background.rgb * (1.0 - albedo.a) + lit * albedo.a, 1.0) * params.share;
}
