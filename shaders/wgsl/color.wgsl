// From scene-linear Rec. 709 radiance to display-encoded colour: color.rs for pictures that stay on the device.

// The sRGB transfer function (IEC 61966-2-1).
fn encode_srgb(v: vec3f) -> vec3f {
    let x = saturate(v);
    return select(1.055 * pow(x, vec3f(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3f(0.0031308));
}

// AgX (Troy Sobotka), in the polynomial form of Benjamin Wrensch ("Minimal AgX Implementation", 2023).
fn agx(v: vec3f) -> vec3f {
    // By columns.
    let inset = mat3x3f(
        vec3f(0.84247906, 0.042328242, 0.042375655),
        vec3f(0.0784336, 0.87846864, 0.0784336),
        vec3f(0.079223745, 0.07916613, 0.87914297),
    );
    let outset = mat3x3f(
        vec3f(1.196879, -0.05289685, -0.052971635),
        vec3f(-0.09802088, 1.1519031, -0.098043450),
        vec3f(-0.099029745, -0.09896118, 1.1510737),
    );
    // Stops around middle grey 0.18 that the curve covers.
    let low = -12.47393;
    let high = 4.026069;
    let x = saturate((log2(max(inset * v, vec3f(1e-10))) - low) / (high - low));
    let x2 = x * x;
    let x4 = x2 * x2;
    let curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    return saturate(outset * curve);
}

// ACES (RRT and sRGB ODT), in the fit of Stephen Hill (BakingLab, 2016).
fn aces(v: vec3f) -> vec3f {
    let input = mat3x3f(
        vec3f(0.59719, 0.076, 0.0284),
        vec3f(0.35458, 0.90834, 0.13383),
        vec3f(0.04823, 0.01566, 0.83777),
    );
    let output = mat3x3f(
        vec3f(1.60475, -0.10208, -0.00327),
        vec3f(-0.53108, 1.10813, -0.07276),
        vec3f(-0.07367, -0.00605, 1.07602),
    );
    let x = input * clamp(v, vec3f(0.0), vec3f(65504.0));
    return encode_srgb(output * ((x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.432951) + 0.238081)));
}
