// Conventions of the shaders: spaces, symbols, units, encodings. Comments only; no file imports this one.
//
// Spaces
//   world      Right-handed, m: x east, y north, z up at the origin. The origin is on the ground, the planet's centre
//              at (0, 0, -R). Positions are world vectors relative to the eye, which is at 0. The eye's own position
//              enters in f64, in Rust, which writes what depends on it to `frame.view` and `frame.sky`.
//   direction  Unit vector in the world. View directions point away from the eye, `sun_direction` toward the sun, and
//              `zenith` away from the planet's centre, at the eye.
//   local      Direction as right, up and forward components of the camera.
//   picture    Pixel (0, 0) is at the top left. Pixel (x, y) covers [x, x + 1) x [y, y + 1); its centre is at + 0.5.
//   chart      Stereographic projection of the planet, m east and north of the eye's own projection (chart.wgsl).
//   map uv     Position in the weather map: u east, v south, 1 per `weather.extent` metres of the chart.
//   tile       Position in a noise, 1 per period. `..._origin` is the eye's horizontal position in a noise or map,
//              after the wind, wrapped in f64; its z belongs to altitude 0.
//   segments   Metres along the parts of a ray that can meet clouds (`Segments` in shell.wgsl).
//   voxel      Position in the user's grid: integers are voxel centres.
//
// Symbols
//   R, r          Planet radius, m; distance of a point to the planet's centre, m.
//   altitude, h   r - R, m. A `height` is a fraction: 0 at the base, 1 at the top of a cloud or of an altitude range.
//   mu            Cosine of the zenith angle of a direction at a point; 1 is up. `mu_sun` is that of the sun. In phase
//                 functions mu is the cosine of the scattering angle; 1 is forward.
//   one_minus_mu  1 - mu of the scattering angle, from the difference of two unit vectors. 1 - mu itself cancels in f32
//                 where phase functions peak. A view ray has one_minus_cos(direction, sun_direction).
//   power         Power of a point for the sphere at altitude H, m^2: r^2 - (R + H)^2 = (h - H)(2R + h + H). Positive
//                 outside; the product of the distances to both crossings of any line through the point.
//   b             r mu, m. A ray crosses that sphere at the distances -b +- sqrt(b^2 - power).
//   share         Fraction in [0, 1].
//   density       Fraction of the largest extinction; times `frame.sky.extinction` it is the extinction in 1/m.
//   width         Footprint of a sample, m: the level of detail. 0 is the finest.
//
// Units
//   Lengths are in m, extinction and scattering coefficients in 1/m, phase functions in 1/sr, angles in radians.
//   Radiance is in the unit of `params.sun.irradiance` per steradian (docs/units.md). Colour is linear, with Rec. 709
//   primaries; color.wgsl alone encodes it for a display. Extinction is a scalar in clouds and a colour in air.
//
// Light along a ray
//   Optical depth is the integral of extinction, transmittance is exp(-optical depth). Loops sum optical depths, as
//   products of transmittances lose their digits. The transmittance LUT holds optical depth, the multiscattering LUT
//   logarithms of radiance, the shadow clipmap transmittance. View rays are integrated front to back.
//   A layer of clouds is premultiplied radiance, with transmittance in alpha; over a background it is
//   radiance + transmittance * background. `image`, the output, has opacity in alpha.
//   Distances are along the ray, not along the camera's axis. In `cloud_depth` and `depth` -1 is no cloud; in
//   `scene_depth` NO_SCENE is no scene. In functions of light and air a `depth` is an optical depth.
//
// Textures
//   Row 0 is north in weather maps and in the user's shadow map, the top in pictures and in the profile table, the
//   zenith in the sky-view LUT. Row 0 is south in volumes, whose z is up, and in the shadow clipmap.
//   LUT coordinates in [0, 1] run from the centre of the first texel to that of the last. Filtered textures are half
//   floats.
//
// Constants
//   An `override` is a specialization constant: Rust sets it as it compiles a kernel (specialization.rs), and branches
//   on it are compiled out. The modules `params`, `uniforms` and `constants` have no file; Rust generates them.
