// Projections: the direction of a pixel and the pixel of a direction, for each kind of camera.
#import math
#import bindings

// Direction of a position in pixels: right, up and forward; w is 1, or 0 outside the circle of a fisheye. The forward
// component of a pinhole is 1, which keeps the digits of narrow views. Directions of the other projections are unit
// vectors. Pixel centres are at half-integers.
fn local_direction(pixel: vec2f) -> vec4f {
    let size = vec2f(f32(frame.view.width), f32(frame.view.height));
    let ndc = vec2f(2.0, -2.0) * (pixel / size) + vec2f(-1.0, 1.0); // right and up, -1 to 1
    var local: vec3f; // right, up, forward
    var valid = 1.0;
    switch CAMERA {
        case EQUIRECT: {
            let longitude = ndc.x * PI;
            let latitude = ndc.y * 0.5 * PI;
            local = vec3f(sin(longitude) * cos(latitude), sin(latitude), cos(longitude) * cos(latitude));
        }
        case FISHEYE: {
            let p = ndc * size / min(size.x, size.y);
            let r = length(p);
            let angle = r * frame.view.half_fov;
            local = vec3f(p / max(r, 1e-9) * sin(angle), cos(angle));
            valid = select(0.0, 1.0, r <= 1.0);
        }
        default: {
            local = vec3f(ndc * vec2f(size.x / size.y, 1.0) * frame.view.tan_half_fov, 1.0);
        }
    }
    return vec4f(local, valid);
}

// Unit direction of a position in pixels, in the world; w as in `local_direction`.
fn view_direction(pixel: vec2f) -> vec4f {
    let local = local_direction(pixel);
    let direction = local.x * frame.view.right + local.y * frame.view.up + local.z * frame.view.forward;
    return vec4f(normalize(direction), local.w);
}

// Solid angle per area of the picture at a position in pixels, relative to its maximum over the picture.
fn place_weight(pixel: vec2f) -> f32 {
    let local = local_direction(pixel).xyz;
    switch CAMERA {
        case EQUIRECT: {
            return length(local.xz);
        }
        case FISHEYE: {
            let sine = length(local.xy);
            return max(select(1.0, sine / atan2(sine, local.z), sine > 1e-3 || local.z < 0.0), 1e-6);
        }
        default: {
            let l = length(local);
            return 1.0 / (l * l * l);
        }
    }
}

// Solid angle of a pixel, sr. `corner` is its upper left corner.
fn pixel_solid_angle(corner: vec2f) -> f32 {
    let size = vec2f(f32(frame.view.width), f32(frame.view.height));
    switch CAMERA {
        case EQUIRECT: {
            let high = PI / size.y;
            let latitude = 0.5 * PI - (corner.y + 0.5) * high;
            return 2.0 * PI / size.x * 2.0 * cos(latitude) * sin(0.5 * high);
        }
        case FISHEYE: {
            let width = 2.0 * frame.view.half_fov / min(size.x, size.y);
            return width * width * place_weight(corner + 0.5);
        }
        default: {
            // Two spherical triangles (Van Oosterom and Strackee 1983). The determinant of each is the area of the
            // pixel at distance 1.
            let a = local_direction(corner).xyz;
            let b = local_direction(corner + vec2f(1.0, 0.0)).xyz;
            let c = local_direction(corner + 1.0).xyz;
            let d = local_direction(corner + vec2f(0.0, 1.0)).xyz;
            let wide = 2.0 * frame.view.tan_half_fov / size.y;
            return 2.0
                * (atan2(wide * wide, triangle_denominator(a, b, c))
                    + atan2(wide * wide, triangle_denominator(a, c, d)));
        }
    }
}

fn triangle_denominator(a: vec3f, b: vec3f, c: vec3f) -> f32 {
    let l = vec3f(length(a), length(b), length(c));
    return l.x * l.y * l.z + dot(a, b) * l.z + dot(b, c) * l.x + dot(c, a) * l.y;
}

// Pixel that is marched for a cell. The last cells may extend beyond the picture: they march the pixel at its edge or,
// at low resolution, a pixel beyond it.
fn marched_pixel(cell: vec2u) -> vec2u {
    let pixel = cell * dispatch.stride + vec2u(dispatch.subpixel_x, dispatch.subpixel_y);
    return select(min(pixel, vec2u(frame.view.width, frame.view.height) - 1u), pixel, LOW_RESOLUTION);
}

// Position in the picture of a direction, given as right, up and forward of the camera: right and up, from -1 to 1
// inside the picture. z is 0 behind the camera.
fn picture_place(local: vec3f, tan_half_fov: f32, half_fov: f32) -> vec3f {
    let size = vec2f(f32(frame.view.width), f32(frame.view.height));
    var ndc: vec2f;
    var valid = true;
    switch CAMERA {
        case EQUIRECT: {
            ndc = vec2f(atan2(local.x, local.z) / PI, asin(clamp(local.y, -1.0, 1.0)) / (0.5 * PI));
        }
        case FISHEYE: {
            let sine = length(local.xy);
            let r = atan2(sine, local.z) / half_fov;
            ndc = local.xy / max(sine, 1e-9) * r * min(size.x, size.y) / size;
        }
        default: {
            valid = local.z > 1e-6;
            ndc = local.xy / max(local.z, 1e-6) / tan_half_fov * vec2f(size.y / size.x, 1.0);
        }
    }
    return vec3f(ndc, select(0.0, 1.0, valid));
}

// Position in pixels of a direction in the picture of the previous frame, possibly outside it. z is 0 behind the
// camera.
fn previous_pixel(direction: vec3f) -> vec3f {
    let local = vec3f(
        dot(direction, frame.view.previous_right),
        dot(direction, frame.view.previous_up),
        dot(direction, frame.view.previous_forward),
    );
    let place = picture_place(local, frame.view.previous_tan_half_fov, frame.view.previous_half_fov);
    let size = vec2f(f32(frame.view.width), f32(frame.view.height));
    return vec3f((place.xy * vec2f(0.5, -0.5) + 0.5) * size, place.z);
}

// Whether the picture has a pixel: inside its four edges, in a panorama between its upper and lower edge, in a fisheye
// inside its circle.
fn in_picture(pixel: vec2i) -> bool {
    let size = vec2i(vec2u(frame.view.width, frame.view.height));
    if CAMERA == FISHEYE {
        return distance(vec2f(pixel) + 0.5, 0.5 * vec2f(size)) <= 0.5 * f32(min(size.x, size.y));
    }
    let within = (pixel >= vec2i(0)) & (pixel < size);
    return within.y && (within.x || CAMERA == EQUIRECT);
}

// Motion across the picture, pixels. In a panorama, which wraps around, it is the shorter of both ways.
fn shortest_way(motion: vec2f) -> vec2f {
    if CAMERA == EQUIRECT {
        let width = f32(frame.view.width);
        return motion - vec2f(width * round(motion.x / width), 0.0);
    }
    return motion;
}

// Width at distance 1 of the pixel at a direction, along its wider side: features narrower than that are lost along it.
// Pixels of a pinhole get narrower away from its axis. Pixels of a panorama get narrower toward its poles but keep
// their height.
fn pixel_width(direction: vec3f) -> f32 {
    switch CAMERA {
        case EQUIRECT: {
            let level = sqrt(max(1.0 - dot(direction, frame.view.up) * dot(direction, frame.view.up), 0.0));
            return PI * max(2.0 * level / f32(frame.view.width), 1.0 / f32(frame.view.height));
        }
        case FISHEYE: {
            return 2.0 * frame.view.half_fov / f32(min(frame.view.width, frame.view.height));
        }
        default: {
            return 2.0 * frame.view.tan_half_fov / f32(frame.view.height) * dot(direction, frame.view.forward);
        }
    }
}
