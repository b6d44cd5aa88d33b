// present.wgsl: shows a finished picture in a window.
//
// Draw      one triangle that covers the window.
// Reads     the picture: its bytes where the device can look at them so, else in linear light.
// Writes    8-bit sRGB as it is: the bytes of the picture, unchanged where the window has its size, else those nearest.
// Limits    none beyond the baseline of WebGPU.

@group(0) @binding(0) var picture: texture_2d<f32>;

// Set where the picture is read in linear light.
override ENCODE: bool = false;

struct Covered {
    @builtin(position) position: vec4f,
    // Across the window, from 0 to 1 from the top left.
    @location(0) place: vec2f,
}

@vertex
fn cover_window(@builtin(vertex_index) corner: u32) -> Covered {
    let at = vec2f(f32(corner & 1u), f32(corner >> 1u)) * 2.0;
    return Covered(vec4f(at.x * 2.0 - 1.0, 1.0 - at.y * 2.0, 0.0, 1.0), at);
}

fn srgb_of_linear(linear: vec3f) -> vec3f {
    let above = 1.055 * pow(max(linear, vec3f(0.0031308)), vec3f(1.0 / 2.4)) - 0.055;
    return select(above, linear * 12.92, linear <= vec3f(0.0031308));
}

@fragment
fn present(covered: Covered) -> @location(0) vec4f {
    let size = textureDimensions(picture);
    let pixel = min(vec2u(covered.place * vec2f(size)), size - 1u);
    let color = textureLoad(picture, pixel, 0).rgb;
    if ENCODE {
        return vec4f(srgb_of_linear(color), 1.0);
    }
    return vec4f(color, 1.0);
}
