// Encoding of scene-linear Rec. 709 radiance for a display; color.rs does the same for pictures in memory.
#import constants

// sRGB transfer function (IEC 61966-2-1).
fn encode_srgb(v: vec3f) -> vec3f {
    let x = saturate(v);
    return select(1.055 * pow(x, vec3f(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3f(0.0031308));
}

// AgX (Troy Sobotka), in the polynomial form of Benjamin Wrensch ("Minimal AgX Implementation", 2023).
fn agx(v: vec3f) -> vec3f {
    let stops = log2(max(AGX_INSET * v, vec3f(1e-10)));
    let x = saturate((stops - AGX_STOPS.x) / (AGX_STOPS.y - AGX_STOPS.x));
    let x2 = x * x;
    let x4 = x2 * x2;
    let curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    return saturate(AGX_OUTSET * curve);
}

// ACES (RRT and sRGB ODT), in the fit of Stephen Hill (BakingLab, 2016).
fn aces(v: vec3f) -> vec3f {
    let x = ACES_INPUT * clamp(v, vec3f(0.0), vec3f(65504.0));
    let fit = (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.432951) + 0.238081);
    return encode_srgb(ACES_OUTPUT * fit);
}
