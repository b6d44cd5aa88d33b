// What a splat is on the screen: shared by all passes that draw splats, so that they agree to the last bit.
//
// With the eye at the origin, z the depth of a ball's centre c, d its distance, r the radius and f the focal length in
// pixels, the silhouette is an ellipse around f z c.xy / (z² - r²) whose longer half axis is f r √(d² - r²) / (z² - r²):
// half of `gigalod_geom::projected::diameter_px`. A round splat is exactly that ellipse, and a square one the square around
// it, so a surface point inside the ball is covered wherever it projects to. A Gaussian is half opaque on that ellipse and
// ends on the silhouette of a ball twice as large.
//
// Elliptical kernels (the splats paper, section 3.3) are the same shapes pressed together along the projected normal, to
// |n·v| of their width, at least a tenth and at least one pixel. What is asked of a pixel is asked of where it lay before.
//
// Quotients are products with the inverse everywhere: some compilers make them so and others not, and the pictures shall be the same.
// For the same reason scalar products are those of dot.wgsl.
//
// The depth is that of the ball's front. A ball that covers a surface point is therefore never drawn behind it.

// 0 square, 1 round, 2 Gaussian; 3 more: elliptical. Host twin: `Kernel`.
override kernel: u32 = 1u;

// A splat is drawn this much larger than its ball, in pixels, so that the rounding of a coordinate opens no hole.
const SLACK_PX: f32 = 0.01;
// Least ratio of the axes of an ellipse.
const LEAST_RATIO: f32 = 0.1;

struct Shape {
    // View space (x right, y up, z forward), world units.
    center: vec3f,
    radius: f32,
    // Distance from the centre at which it ends; a Gaussian: is half opaque. World units.
    reach: f32,
    // Middle of the silhouette, from the top left corner, and half its long axis; of all that shows.
    middle_px: vec2f,
    half_px: f32,
    // Direction in the picture in which it is pressed together, and width before over width after.
    axis: vec2f,
    stretch: f32,
    // Pixels it may show in: first column and row, column and row after the last.
    window: vec4i,
}

// Where the ray of a pixel meets a splat.
struct Meeting {
    covered: bool,
    // Distance along the view axis, world units.
    z: f32,
    // Distance from the middle over `reach`, squared.
    off_squared: f32,
}

fn is_square() -> bool {
    return kernel % 3u == 0u;
}

fn is_gauss() -> bool {
    return kernel % 3u == 2u;
}

fn is_elliptical() -> bool {
    return kernel >= 3u;
}

// Centre of a ball in view space.
fn in_view(part: PartParams, center_in_eye: vec3f) -> vec3f {
    return vec3f(
        dot3(center_in_eye, part.right.xyz),
        dot3(center_in_eye, part.up.xyz),
        dot3(center_in_eye, part.forward.xyz),
    );
}

fn shape_of(part: PartParams, ball: vec4f, normal_code: u32) -> Shape {
    var out: Shape;
    let c = in_view(part, ball.xyz);
    let r = ball.w * part.world_from_model;
    out.center = c;
    out.radius = r;
    let pixel = abs(c.z) * frame.per_focal_px;
    out.reach = r + SLACK_PX * pixel;
    // All that shows lies in the silhouette of a ball this large, and the slack.
    var end = r;
    var slack_px = SLACK_PX;
    if is_gauss() {
        // Half opaque at least half a pixel around its middle: it reaches the pixel's centre, whatever falls between.
        out.reach = max(out.reach, 0.5 * pixel);
        end = 2.0 * out.reach;
        slack_px = 0.0;
    }
    let band = vec4f(0.0, f32(frame.first_row), frame.size_px.x, f32(frame.end_row));
    out.axis = vec2f(1.0, 0.0);
    out.stretch = 1.0;
    // A ball that reaches the plane of the eye may show anywhere: then the whole picture is tried.
    if c.z <= end {
        out.middle_px = frame.size_px * 0.5;
        out.half_px = frame.size_px.x + frame.size_px.y;
        // Nothing of what lies wholly behind it.
        out.window = select(vec4i(0), vec4i(band), c.z + end > 0.0);
        return out;
    }
    let to_px = frame.focal_px * (1.0 / ((c.z - end) * (c.z + end)));
    out.middle_px = frame.middle_px + vec2f(c.x, -c.y) * (to_px * c.z);
    out.half_px = to_px * end * sqrt(max(dot3(c, c) - end * end, 0.0)) + slack_px;
    var extent = vec2f(out.half_px);
    if is_elliptical() {
        let n = normal_of(normal_code);
        let facing = abs(dot3(n, ball.xyz)) * inverseSqrt(max(dot3(ball.xyz, ball.xyz), 1e-30));
        let nominal_px = select(out.half_px, out.half_px * 0.5, is_gauss());
        let ratio = min(max(max(facing, LEAST_RATIO), 0.5 * (1.0 / nominal_px)), 1.0);
        // How the projection moves along the normal.
        let n_view = in_view(part, n);
        let along = vec2f(n_view.x * c.z - c.x * n_view.z, c.y * n_view.z - n_view.y * c.z);
        let length_squared = dot2(along, along);
        if length_squared > 0.0 {
            out.axis = along * inverseSqrt(length_squared);
            out.stretch = 1.0 / ratio;
        }
        let a = abs(out.axis);
        if is_square() {
            let press = 1.0 - ratio;
            extent *= vec2f(1.0 - press * a.x * a.x + press * a.x * a.y, 1.0 - press * a.y * a.y + press * a.x * a.y);
        } else {
            extent *= sqrt(1.0 - (1.0 - ratio * ratio) * a * a);
        }
        extent += SLACK_PX;
    }
    let first = clamp(ceil(out.middle_px - extent - 0.5), band.xy, band.zw);
    // Empty where no pixel's centre lies inside.
    let end_px = max(clamp(floor(out.middle_px + extent + 0.5), band.xy, band.zw), first);
    out.window = vec4i(vec4f(first, end_px));
    return out;
}

// The ray of a point of the picture is (slope, 1) · depth.
fn slope_at(position_px: vec2f) -> vec2f {
    let from_middle = position_px - frame.middle_px;
    return vec2f(from_middle.x, -from_middle.y) * frame.per_focal_px;
}

// Squared distance of the ray through a point of the picture from the centre.
fn apart_squared(shape: Shape, position_px: vec2f) -> f32 {
    let slope = slope_at(position_px);
    let aside = slope * shape.center.z - shape.center.xy;
    let along = dot2(aside, slope);
    return dot2(aside, aside) - along * along * (1.0 / (1.0 + dot2(slope, slope)));
}

// A pixel of the splat's window.
fn meet(shape: Shape, pixel: vec2i) -> Meeting {
    let position_px = vec2f(pixel) + 0.5;
    let c = shape.center;
    let r = shape.radius;
    let slope = slope_at(position_px);
    // Where the ray passes the centre, at the centre's depth.
    let aside = slope * c.z - c.xy;
    let stretch = 1.0 + dot2(slope, slope);
    let per_stretch = 1.0 / stretch;
    let along = dot2(aside, slope);
    let apart = dot2(aside, aside) - along * along * per_stretch;

    var out: Meeting;
    var shape_apart = apart;
    out.covered = true;
    if is_elliptical() {
        let offset = position_px - shape.middle_px;
        let before = offset + shape.axis * (dot2(offset, shape.axis) * (shape.stretch - 1.0));
        if is_square() {
            out.covered = max(abs(before.x), abs(before.y)) <= shape.half_px;
        } else {
            shape_apart = apart_squared(shape, shape.middle_px + before);
        }
    }
    out.off_squared = shape_apart * (1.0 / (shape.reach * shape.reach));
    if is_gauss() {
        out.covered = out.off_squared < 4.0;
    } else if !is_square() {
        out.covered = shape_apart <= shape.reach * shape.reach;
    }
    // Nearest point of the ball on the ray; outside the ball, in a square's corners, the depth of the nearest point to it.
    let half_chord = sqrt(max(r * r - apart, 0.0) * stretch);
    out.z = max(c.z - (along + half_chord) * per_stretch, frame.near);
    // Behind the eye: the ray meets the ball only where it does not go.
    out.covered = out.covered && c.z - (along - half_chord) * per_stretch > frame.near;
    return out;
}

// Largest distance between two pixels of a splat as far as it is at least half opaque.
fn footprint_of(shape: Shape) -> f32 {
    let c = shape.center;
    let most = max(frame.size_px.x, frame.size_px.y) * 2.0;
    let end = select(shape.radius, shape.reach, is_gauss());
    if c.z <= end {
        return most;
    }
    let per_gap = 1.0 / ((c.z - end) * (c.z + end));
    let half_px = frame.focal_px * end * sqrt(max(dot3(c, c) - end * end, 0.0)) * per_gap;
    // A square's diagonal is √2 times its side.
    return min(half_px * select(2.0, 2.828427, is_square()), most);
}

// Linear light of a 5-6-5 sRGB colour.
fn color_of(packed: u32) -> vec3f {
    let steps = vec3f(vec3u(packed >> 11u, (packed >> 5u) & 63u, packed & 31u));
    let encoded = steps * vec3f(1.0 / 31.0, 1.0 / 63.0, 1.0 / 31.0);
    let curve = pow((encoded + 0.055) * (1.0 / 1.055), vec3f(2.4));
    return select(curve, encoded * (1.0 / 12.92), encoded <= vec3f(0.04045));
}

// Tangent of -π/4 … π/4, to the last bits of a float (the polynomial of the Cephes library's `tanf`). Devices may be slow at the
// general function.
fn tangent(angle: vec2f) -> vec2f {
    let t = angle * angle;
    let high = ((9.38540185543e-3 * t + 3.11992232697e-3) * t + 2.44301354525e-2) * t + 5.34112807005e-2;
    return angle + angle * t * ((high * t + 1.33387994085e-1) * t + 3.33331568548e-1);
}

// Unit vector of a 14-bit normal; CPU twin: `gigalod_geom::quantise::normal::decode`.
fn normal_of(code: u32) -> vec3f {
    // code / 52² and code / 52, exact for all codes: division of whole numbers is slow.
    let face = (code * 24819u) >> 26u;
    let row = (code * 10083u) >> 19u;
    let cell = vec2f(vec2u(code - row * 52u, row - face * 52u));
    let slopes = tangent(0.7853981634 * ((cell * 2.0 + 1.0) * (1.0 / 52.0) - 1.0));
    let axis = face >> 1u;
    let major = inverseSqrt(1.0 + dot2(slopes, slopes));
    let minor = slopes * major;
    let signed = select(major, -major, (face & 1u) == 1u);
    return select(
        select(vec3f(minor, signed), vec3f(minor.y, signed, minor.x), axis == 1u),
        vec3f(signed, minor),
        axis == 0u,
    );
}

// Normal of a splat, in world axes.
fn normal_in_world(part: PartParams, normal_code: u32) -> vec3f {
    let n = normal_of(normal_code);
    return part.model_x.xyz * n.x + part.model_y.xyz * n.y + part.model_z.xyz * n.z;
}
