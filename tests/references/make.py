"""Makes the reference pictures and numbers that test_oracle.py and test_phase.py compare with.

    python tests/references/make.py exact FOLDER [CASE ...]
    python tests/references/make.py mitsuba FOLDER [CASE ...]
    python tests/references/make.py disort
    python tests/references/make.py mie

FOLDER holds two programs, `exact_single.py` (single scattering in float64, without noise) and
`mitsuba_grid.py` (path tracing by Mitsuba 3); they run in processes of their own. Install what
they need in a virtual environment beside the one of nubis, and start this file with its Python:

    pip install numpy numba                  # exact
    pip install mitsuba==3.9.1               # mitsuba, and Debian's libllvm19
    pip install PythonicDISORT==1.8          # disort
    pip install miepython==3.3.0             # mie

Each case becomes NAME.json, its settings with what is known of its error, and NAME.npz, float32:

    exact_*     radiance, transmittance (H, W)
    mitsuba_*   tiles, tiles_error: means of tiles of 8 x 8 pixels and their standard errors

Radiance is for an irradiance of 1. disort.json and mie.json have their numbers in themselves. On
two cores `exact` takes two minutes, `mitsuba` half an hour on a busy machine, `mie` a minute and
`disort` seconds.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

import grids  # noqa: E402

# Vertical field of view, azimuth (clockwise from north) and elevation of the sun in degrees.
KEYS = ["grid", "scale", "eye", "target", "fov_y", "azimuth", "elevation", "g", "albedo"]

# 48 x 32 pixels.
EXACT = {
    "blob_beside": ("blob", 0.3, (300, -1500, 1500), (0, 2500, 1700), 20, 80, 35, 0.6, 1),
    "blob_against": ("blob", 0.5, (0, -1500, 400), (0, 2500, 1700), 20, 5, 20, 0.99, 0.95),
    "cumulus_below": ("cumulus", 1, (100, 600, 150), (0, 2050, 1600), 42, 180, 55, 0.9, 0.99),
    "cumulus_inside": ("cumulus", 0.15, (90, 1900, 1500), (-900, 2400, 1600), 70, 250, 30, -0.3, 1),
    "cumulus_above": ("cumulus", 1, (-600, 500, 4500), (0, 2050, 1500), 26, 90, 4, 0, 0.9),
    "layer_grazing": ("layer", 0.2, (-200, -4500, 1250), (200, 2000, 1160), 6, 120, 15, 0.6, 0.99),
    "layer_below": ("layer", 0.6, (0, 1800, 300), (0, 2200, 1200), 70, 200, 60, 0.9, 1),
    "wisps_against": ("wisps", 1, (0, -800, 300), (0, 2200, 1500), 22, 0, 25, 0.6, 0.98),
    "dense_front": ("dense", 1, (400, -1200, 900), (0, 1850, 1250), 26, 185, 25, 0.85, 0.999),
    "dense_above": ("dense", 1, (0, 200, 3500), (0, 1850, 1250), 28, 300, 3, 0.99, 1),
    "rough_inside": ("rough", 0.4, (-300, 1300, 700), (500, 2000, 800), 60, 120, 40, 0, 0.5),
}

# 64 x 48 pixels. The scale is what makes the deepest ray of the camera as deep as it says.
MITSUBA = {
    "tau_5": ("blob", 5, (300, -1500, 1500), (0, 2500, 1700), 20, 80, 40, 0, 1),
    "tau_20": ("cumulus", 20, (100, -1600, 700), (0, 2050, 1700), 22, 150, 45, 0.6, 0.99),
    "tau_60": ("dense", 60, (400, -1200, 900), (0, 1850, 1250), 22, 240, 30, 0.85, 0.9),
    "events_4": ("blob", 20, (-2600, 1200, 3500), (0, 2500, 1700), 20, 270, 25, 0.6, 1),
}
# Most scatterings of a path; the others have no limit.
EVENTS = {"events_4": 4}
# Paths a pixel in each of BATCHES runs with seeds of their own.
PATHS = {"tau_5": 1024, "tau_20": 384, "tau_60": 768, "events_4": 1024}
BATCHES = 8

# Optical depth, albedo, g, cosine of the sun against the normal; directions: cosine of the light
# that is seen against up (negative: seen from below), and the angle in degrees between the
# verticals of view and sun (0: looking toward the sun's side).
SLABS = {
    "tau_4": (4, 0.95, 0.6, 0.6),
    "tau_10": (10, 0.99, 0.3, 0.8),
}
DIRECTIONS = [
    (0.9, 180),
    (0.9, 0),
    (0.5, 180),
    (0.5, 0),
    (0.5, 90),
    (0.3, 36.76056),
    (-0.9, 0),
    (-0.5, 90),
]
# The six numbers that Mitsuba agreed with (2.6e5 paths each): directions 0 to 5 of tau_4.
KNOWN = [0.058398, 0.074786, 0.064215, 0.131271, 0.083035, 0.143326]


def toward(azimuth, elevation):
    a, e = math.radians(azimuth), math.radians(elevation)
    return math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)


def run(program, folder, case, size, unit, *options):
    """The arrays that an oracle writes; `unit` metres are 1 in its world."""
    extinction, bounds = grids.make(case["grid"], case["scale"])
    width, height = size
    fov_x = 2 * math.atan(math.tan(math.radians(case["fov_y"]) / 2) * width / height)
    camera = {
        "origin": [v / unit for v in case["eye"]],
        "target": [v / unit for v in case["target"]],
        "up": [0, 0, 1],
        "fov_x_deg": math.degrees(fov_x),
        "width": width,
        "height": height,
        "bbox_min": [v / unit for v in bounds[0]],
        "bbox_max": [v / unit for v in bounds[1]],
    }
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        np.save(place / "density.npy", extinction)
        (place / "camera.json").write_text(json.dumps(camera))
        sun = [f"{v:.17f}" for v in toward(case["azimuth"], case["elevation"])]
        command = [sys.executable, Path(folder).resolve() / program, "--sun-dir", *sun]
        command += ["--density", "density.npy", "--camera", "camera.json", "--out", "out"]
        command += ["--sigma-scale", unit, "--g", case["g"], "--albedo", case["albedo"], *options]
        subprocess.run([str(v) for v in command], cwd=place, check=True)
        return {path.stem.removeprefix("out_"): np.load(path) for path in place.glob("out_*.npy")}


def case_of(values, size):
    case = dict(zip(KEYS, values, strict=True))
    # Tells a changed grid from a changed renderer.
    total = float(grids.make(case["grid"])[0].sum(dtype=np.float64))
    return case | {"width": size[0], "height": size[1], "sum_of_grid": total}


def write(name, settings, **arrays):
    (HERE / f"{name}.json").write_text(json.dumps(settings, indent=1) + "\n")
    if arrays:
        arrays = {key: value.astype(np.float32) for key, value in arrays.items()}
        np.savez_compressed(HERE / f"{name}.npz", **arrays)


def exact(folder, names):
    for name in names or EXACT:
        size = 48, 32
        case = case_of(EXACT[name], size)
        coarse, fine = (
            run("exact_single.py", folder, case, size, 1.0, "--order", order, "--split", split)
            for order, split in ((6, 12), (6, 48))
        )
        image = fine["radiance"]
        error = np.abs(coarse["radiance"] - image)
        made = {
            "program": "exact_single.py --order 6 --split 48",
            "largest_change_from_split_12_over_peak": float(error.max() / image.max()),
            "rms_change_over_mean": float(np.sqrt(np.mean(error**2)) / image.mean()),
            "least_transmittance": float(fine["transmittance"].min()),
        }
        print(name, made)
        write(f"exact_{name}", case | {"made": made}, **fine)


def tiles(image):
    height, width = image.shape
    return image.reshape(height // 8, 8, width // 8, 8).mean(axis=(1, 3))


def mitsuba(folder, names):
    for name in names or MITSUBA:
        size = 64, 48
        case = case_of(MITSUBA[name], size)
        depth = case["scale"]
        case["scale"] = 1.0
        quick = ["--spp", 1, "--max-depth", 2]
        clear = run("mitsuba_grid.py", folder, case, size, 1000.0, *quick)["transmittance"]
        case["scale"] = round(-depth / math.log(clear.min()), 6)
        events = EVENTS.get(name, -1)
        options = ["--spp", PATHS[name], "--max-depth", events if events < 0 else events + 1]
        # No roulette before the fiftieth scattering: less noise for a little time.
        options += ["--rr-depth", 50]
        batches = [
            run("mitsuba_grid.py", folder, case, size, 1000.0, *options, "--seed", seed)
            for seed in range(1, BATCHES + 1)
        ]
        means = np.array([b["radiance"] for b in batches], dtype=np.float64)
        pixels = np.sqrt(np.mean([b["stderr"] ** 2 for b in batches], axis=0) / BATCHES)
        mean, error = tiles(means.mean(axis=0)), np.sqrt(tiles(pixels**2) / 64)
        # The same error from how much the batches differ, which does not trust the program's.
        image = means.mean(axis=(1, 2))
        made = {
            "program": "mitsuba_grid.py, Mitsuba 3.9.1, llvm_ad_mono, volpath",
            "paths_a_pixel": PATHS[name] * BATCHES,
            "mean": float(image.mean()),
            "mean_error": float(np.sqrt(np.mean(pixels**2) / pixels.size)),
            "mean_error_by_batches": float(image.std(ddof=1) / np.sqrt(BATCHES)),
            "least_transmittance": float(batches[0]["transmittance"].min()),
        }
        lit = mean > 0.1 * mean.max()
        made["median_error_of_lit_tiles"] = float(np.median(error[lit] / mean[lit]))
        print(name, made)
        settings = case | {"scatterings": events if events > 0 else None, "made": made}
        write(f"mitsuba_{name}", settings, tiles=mean, tiles_error=error)


def disort(*_):
    import PythonicDISORT as Disort

    def radiance(slab, streams, mu, between):
        depth, albedo, g, sun = slab
        moments = g ** np.arange(streams)
        # The beam, of irradiance 1, travels toward azimuth pi: light that is seen when looking
        # toward the sun's side travels the same way.
        _, _, _, _, u = Disort.pydisort(
            np.array([depth]),
            np.array([albedo]),
            streams,
            moments[None],
            sun,
            1.0,
            np.pi,
            NLeg=streams,
            f_arr=np.array([g**streams]),
            NT_cor=g != 0,
        )
        u = Disort.subroutines.interpolate(u)
        tau = 0.0 if mu > 0 else depth
        return float(np.squeeze(u(mu, tau, np.pi - np.radians(between))))

    slabs = {}
    for name, slab in SLABS.items():
        fine, coarse = (np.array([radiance(slab, n, *d) for d in DIRECTIONS]) for n in (64, 48))
        slabs[name] = dict(zip(("depth", "albedo", "g", "sun_cosine"), slab, strict=True))
        slabs[name]["radiance"] = [
            {"cosine": mu, "between": between, "value": round(value, 9)}
            for (mu, between), value in zip(DIRECTIONS, fine.tolist(), strict=True)
        ]
        slabs[name]["largest_relative_change_from_48_streams"] = float(
            np.max(np.abs(coarse / fine - 1))
        )
        print(name, slabs[name])
        if name == "tau_4":
            np.testing.assert_allclose(coarse[:6], KNOWN, rtol=1e-4)
    made = {"program": "PythonicDISORT 1.8, 64 streams, delta-M, Nakajima-Tanaka correction"}
    write("disort", {"slabs": slabs, "made": made})


def mie(*_):
    """The phase function of water droplets by miepython, in twice as many colours as we take."""
    import miepython

    # CIE 1924 photopic.
    seen = {
        0.47: 0.091, 0.49: 0.208, 0.51: 0.503, 0.53: 0.862, 0.55: 0.995,
        0.57: 0.952, 0.59: 0.757, 0.61: 0.503, 0.63: 0.265, 0.65: 0.107,
    }  # fmt: skip
    # Refractive index of water at 20 degrees, Daimon and Masumura 2007: squares of um.
    strengths = np.array([5.684027565e-1, 1.726177391e-1, 2.086189578e-2, 1.130748688e-1])
    poles = np.array([5.101829712e-3, 1.821153936e-2, 2.620722293e-2, 1.069792721e1])
    variance = 0.05
    angles = [
        0, 0.1, 0.3, 0.6, 1, 1.5, 2, 3, 5, 8, 12, 20, 30, 45, 60, 75, 90, 100, 110, 120, 130, 135,
        137, 138, 139, 140, 141, 142, 143, 144, 145, 147, 150, 155, 160, 165, 170, 174, 176, 177,
        177.5, 178, 178.5, 179, 179.5, 180,
    ]  # fmt: skip
    droplets = {}
    for diameter in (5, 10, 20, 50):
        shares = np.linspace(0.2, 2.4, 161)
        count = shares ** ((1 - 3 * variance) / variance) * np.exp(-shares / variance)
        intensity, scattered, cosine = np.zeros(len(angles)), 0.0, 0.0
        for wavelength, weight in seen.items():
            square = wavelength**2
            index = np.sqrt(1 + (strengths * square / (square - poles)).sum())
            for share, number in zip(shares, count, strict=True):
                radius = 0.5 * diameter * share
                x = 2 * np.pi * radius / wavelength
                part = weight * number * radius**2
                _, efficiency, _, g = miepython.efficiencies_mx(index, x)
                mu = np.cos(np.radians(angles))
                phase = miepython.i_unpolarized(index, x, mu, norm="one")
                intensity += part * efficiency * phase
                scattered += part * efficiency
                cosine += part * efficiency * g
        droplets[str(diameter)] = {
            "mean_cosine": round(float(cosine / scattered), 6),
            "phase": [float(f"{v:.6g}") for v in intensity / scattered],
        }
        print(diameter, droplets[str(diameter)])
    made = {"program": f"miepython {miepython.__version__}", "effective_variance": variance}
    write("mie", {"angles": angles, "droplets": droplets, "made": made})


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["exact", "mitsuba", "disort", "mie"])
    parser.add_argument("folder", nargs="?", help="where the programs are")
    parser.add_argument("case", nargs="*", help="all of them if left out")
    given = parser.parse_args()
    if given.what in ("exact", "mitsuba") and not given.folder:
        parser.error(f"{given.what} needs the folder of the programs")
    makers = {"exact": exact, "mitsuba": mitsuba, "disort": disort, "mie": mie}
    makers[given.what](given.folder, given.case)


if __name__ == "__main__":
    main()
