// A splat as passes deliver it; how near it is says nearness.wgsl.

struct Splat {
    shape: Shape,
    // Its place among all splats of the frame.
    number: u32,
    // Linear light, and world space, turned towards the eye: only where `blends()`.
    albedo: vec3f,
    normal: vec3f,
}

// True where what a splat looks like is needed while it is drawn, not after.
fn blends() -> bool {
    return is_gauss() && frame.phase == 1u;
}

fn splat_of(part: PartParams, ball: vec4f, normal_color: u32, number: u32) -> Splat {
    var out: Splat;
    out.shape = shape_of(part, ball, normal_color & 0x3fffu);
    out.number = number;
    if blends() {
        out.albedo = color_of(normal_color >> 16u);
        let normal = normal_of(normal_color & 0x3fffu);
        let along = dot3(normal, ball.xyz);
        let away = along > 0.0 && along * along > GRAZING_TURN * GRAZING_TURN * dot3(ball.xyz, ball.xyz);
        let turned = select(normal, -normal, away);
        out.normal = part.model_x.xyz * turned.x + part.model_y.xyz * turned.y + part.model_z.xyz * turned.z;
    }
    return out;
}

// Sine of the angle from which on a normal that points away is turned before it is blended; as GRAZING in light.wgsl.
const GRAZING_TURN: f32 = 0.25;
