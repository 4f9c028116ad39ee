"""The benchmarks: their metrics against numbers worked out by hand, and a quick run of all."""

import csv
import json
import math
from importlib.util import find_spec
from itertools import pairwise

import numpy as np
import pytest

import nubis
from benchmarks import __main__ as command
from benchmarks import (
    counts,
    heat,
    measure,
    methods,
    metrics,
    page,
    plots,
    profile,
    reference,
    shapes,
    soak,
)


def layers(radiance, transmittance, sky=0.0):
    """Of a picture one pixel high, grey."""
    radiance = np.float32([radiance])
    return {
        "radiance": np.stack([radiance] * 3, axis=-1),
        "transmittance": np.float32([transmittance]),
        "sky": np.full((*radiance.shape, 3), sky, np.float32),
    }


def test_errors():
    """Two pixels of cloud, one of clear sky, whose error counts in the percentile alone."""
    truth = layers([1.0, 3.0, 0.0], [0.5, 0.0, 1.0])
    test = layers([1.5, 2.0, 4.0], [0.75, 0.0, 1.0])
    found = metrics.errors(test, truth)
    # Differences 0.5 and -1, mean radiance 2.
    assert found["rel_rmse"] == pytest.approx(math.sqrt((0.25 + 1) / 2) / 2)
    assert found["bias"] == pytest.approx(-0.25 / 2)
    # Linear between the sorted errors 0.5, 1, 4, at 0.999 of the way.
    assert found["p999"] == pytest.approx(1 + 0.998 * 3)
    assert found["t_rmse"] == pytest.approx(0.25 / math.sqrt(3))
    assert found["t_max"] == pytest.approx(0.25)


def test_which_pixels_are_cloud():
    """Optical depth 0.0011 is, 0.0009 is not."""
    truth = layers([1.0, 1.0], np.exp([-0.0011, -0.0009]))
    found = metrics.errors(layers([2.0, 5.0], truth["transmittance"][0]), truth)
    assert found["rel_rmse"] == pytest.approx(1)
    assert found["bias"] == pytest.approx(1)


def test_composed():
    pixel = metrics.composed(layers([0.25], [0.5]), layers([0], [1], sky=3.0)["sky"])
    assert pixel.tolist() == [[[1.75] * 3]]


@pytest.mark.skipif(not find_spec("flip_evaluator"), reason="the extra `bench` is not installed")
def test_flip():
    grey = np.full((16, 16, 3), 0.5, np.float32)
    assert metrics.flip(grey, grey) == 0
    assert 0.1 < metrics.flip(2 * grey, grey) < 1


def test_enlarge():
    """A ramp stays a ramp between the outer pixel centres, and is held beyond them."""
    ramp = np.array([[0.0, 2.0, 4.0]])
    assert metrics.enlarge(ramp, 2)[0] == pytest.approx([0, 0.5, 1.5, 2.5, 3.5, 4])
    assert metrics.enlarge(ramp, 2).shape == (2, 6)
    assert metrics.enlarge(ramp.T, 2)[:, 1] == pytest.approx([0, 0.5, 1.5, 2.5, 3.5, 4])
    assert metrics.enlarge(ramp[..., None] * [1, 10], 3)[0, 4] == pytest.approx([2, 20])


def test_line_fit():
    """By hand: through (0, 1), (1, 2), (2, 6) goes y = 0.5 + 2.5 x; residuals 0.5, -1, 0.5."""
    line = shapes.fit([0, 1, 2], [1, 2, 6])
    assert line["slope"] == pytest.approx(2.5)
    assert line["intercept"] == pytest.approx(0.5)
    assert line["r2"] == pytest.approx(1 - 1.5 / 14)


def test_evaluations_in_step():
    """Nine pixels a row make two groups; each pays eight times its largest."""
    samples = np.array([[1, 2, 3, 4, 5, 6, 7, 8, 10], [0] * 9])
    assert shapes.in_step(samples) == pytest.approx(8 * (8 + 10) / 18)


def test_pareto_front():
    points = [(1, 5), (2, 6), (3, 2), (3, 1), (4, 1), (5, 0.5)]
    rows = [{"seconds": x, "rel_rmse": y} for x, y in points]
    assert [(r["seconds"], r["rel_rmse"]) for r in plots.pareto(rows)] == [(1, 5), (3, 1), (5, 0.5)]


def test_methods():
    """Names are unique, the last of a family is its finest, and every quality is allowed."""
    for chosen in methods.full(), methods.quick():
        assert len({m.name for m in chosen}) == len(chosen)
        for family in {m.family for m in chosen} - set(methods.PRESETS):
            values = [m.value for m in chosen if m.family == family]
            assert values == sorted(values, reverse="resolution" in family) and len(values) > 1
        for method in chosen:
            nubis.Renderer(1, 1, quality=method.quality)


def test_page_blocks():
    text = "a\n<!-- begin x -->\nold\n<!-- end x -->\nb"
    new = page.fill(text, "x", r"\1 new")
    assert new == "a\n<!-- begin x -->\n\\1 new\n<!-- end x -->\nb"
    for broken in text.replace("begin", "no"), text.replace("end", "no"), text + text:
        with pytest.raises(ValueError, match="markers"):
            page.fill(broken, "x", "")


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """The folder of a quick run with its own references."""
    out = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reference, "CACHE", out / "references")
        command.main(["--quick", "--out", str(out)])
    return out


def test_references_are_stored(tmp_path, monkeypatch):
    """And read again, until a shader changes."""
    monkeypatch.setattr(reference, "CACHE", tmp_path)
    first = reference.reference_layers("fair_weather", (16, 9))
    assert first["radiance"].shape == (9, 16, 3)
    (stored,) = tmp_path.iterdir()
    np.savez(stored, radiance=first["radiance"] + 1)
    again = reference.reference_layers("fair_weather", (16, 9))
    assert (again["radiance"] == first["radiance"] + 1).all()
    monkeypatch.setattr(reference, "shader_hash", lambda: "changed")
    anew = reference.reference_layers("fair_weather", (16, 9))
    assert (anew["radiance"] == first["radiance"]).all() and len(list(tmp_path.iterdir())) == 2


@pytest.mark.slow
def test_quick_run(quick):
    results = json.loads((quick / "results.json").read_text())
    head, rows = results["header"], results["rows"]
    assert head["version"] == nubis.__version__
    assert head["adapter"]["name"] == nubis.Renderer(1, 1).adapter.name
    assert set(head) >= {"date", "cpu", "cores", "command", "reference", "shaders"}
    assert set(head["seeds"]) == {row["scene"] for row in rows}
    wanted = {(s, m.name) for s in head["seeds"] for m in methods.quick()}
    assert {(row["scene"], row["method"]) for row in rows} == wanted and len(rows) == len(wanted)
    for row in rows:
        numbers = [v for k, v in row.items() if k != "flip" and isinstance(v, int | float)]
        assert np.isfinite(numbers).all()
        assert 0 < row["seconds"] <= row["seconds_p95"]
        assert row["evaluations"] > 0 and 0 < row["rel_rmse"] < 2 and 0 <= row["t_max"] <= 1
        assert (row["flip"] is not None) == bool(find_spec("flip_evaluator"))
    for scene in head["seeds"]:
        found = {row["method"]: row for row in rows if row["scene"] == scene}
        assert found["balanced"]["rel_rmse"] < found["draft"]["rel_rmse"]
        few, many = (found[f"draft: view steps {n}"] for n in (24, 96))
        assert few["evaluations"] < many["evaluations"] and few["rel_rmse"] > many["rel_rmse"]
        # Counted on pixels of the whole picture.
        small = found["draft: resolution 1/4"]["evaluations"]
        assert small == pytest.approx(found["draft"]["evaluations"] / 16, rel=0.25)


@pytest.mark.slow
def test_quick_table(quick):
    """The table holds what the JSON holds."""
    rows = json.loads((quick / "results.json").read_text())["rows"]
    with open(quick / "results.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(rows)
    for line, row in zip(table, rows, strict=True):
        assert line == {k: "" if v is None else str(v) for k, v in row.items()}


@pytest.mark.slow
def test_quick_shapes(quick):
    found = json.loads((quick / "shapes.json").read_text())
    (sweep,) = found["sweeps"]
    evaluations = [row["evaluations"] for row in sweep["rows"]]
    steps = [row["value"] for row in sweep["rows"]]
    # View and light samples both grow with the view steps, whatever the clock says.
    assert shapes.fit(steps, evaluations)["r2"] > 0.99
    assert all(r["evaluations"] <= r["evaluations_in_step"] for r in sweep["rows"])


@pytest.mark.slow
@pytest.mark.skipif(not find_spec("matplotlib"), reason="the extra `bench` is not installed")
def test_quick_plots(quick):
    names = {path.stem for path in (quick / "plots").iterdir()}
    scenes = ["fair_weather", "above", "summary"]
    axes = ["seconds", "evaluations"]
    assert names == {f"{s}-{a}" for s in scenes for a in axes} | {"shapes"}
    assert all(path.stat().st_size < 150 * 1024 for path in (quick / "plots").iterdir())


@pytest.mark.slow
def test_quick_page(quick, tmp_path):
    """All blocks are filled; what was not measured is left."""
    copy = tmp_path / "accuracy.md"
    copy.write_text(page.PAGE.read_text())
    page.write(quick, copy)
    text = copy.read_text()
    for row in json.loads((quick / "results.json").read_text())["rows"]:
        if plots.is_preset(row):
            assert (
                f"{page._percent(row['rel_rmse'])} ({page._number(1000 * row['seconds'])} ms)"
                in text
            )
    assert 'quality="reference"' in text.split("begin about the errors")[1]
    soak_before, soak_after = (t.split("begin soak")[1] for t in (page.PAGE.read_text(), text))
    assert soak_before == soak_after


def test_geometric_mean():
    rows = [
        {"method": "a", "family": "a", "scene": s, "bias": b, "t_max": t, "flip": None}
        | {"setup_seconds": v}
        | {n: v for n in ("seconds", "seconds_p95", "evaluations", "rel_rmse", "p999", "t_rmse")}
        for s, b, t, v in [("x", 0.5, 0.1, 2.0), ("y", -0.1, 0.3, 8.0)]
    ]
    (mean,) = plots.geometric_mean(rows)
    assert mean["seconds"] == mean["rel_rmse"] == pytest.approx(4)
    assert mean["setup_seconds"] == pytest.approx(5)
    assert mean["bias"] == pytest.approx(0.2) and mean["t_max"] == 0.3 and mean["flip"] is None


@pytest.mark.slow
def test_soak(tmp_path, monkeypatch):
    """Two short shots."""
    monkeypatch.setattr(soak, "SHOT", 6)
    monkeypatch.setattr(soak, "READING", 2)
    path = tmp_path / "soak.json"
    assert soak.main(["--frames", "12", "--out", str(path)]) == 0
    found = json.loads(path.read_text())
    assert found["faults"] == [] and found["cuts"] == 1 and found["stills_compared"] == 2
    assert found["header"]["version"] == measure.nubis.__version__


def test_soak_sees_faults():
    good = {
        "broken_frames": 0,
        "lowest": 0.0,
        "stills_that_differ": 0,
        "still_equals_new_process": True,
        "static_shot_equals_still": True,
        "held_rel_rmse": 0.01,
    }
    assert soak.faults(good) == []
    bad = {
        "broken_frames": 1,
        "lowest": -1e-6,
        "stills_that_differ": 1,
        "still_equals_new_process": False,
        "static_shot_equals_still": False,
        "held_rel_rmse": float("nan"),
    }
    for name, value in bad.items():
        assert len(soak.faults(good | {name: value})) == 1


FAIR = nubis.scenes["fair_weather"]
#: With one weather map, as the sources have.
PLAIN = FAIR[0], FAIR[1].with_(**{"weather.broad_variety": 0.0, "light.model": "octaves"})


@pytest.fixture(scope="module")
def panels():
    # So high that pixels are less than a quarter of a degree wide, past which every one is marched.
    return {panel.name: panel.reads for panel in heat.panels(*FAIR, (64, 280))}


@pytest.mark.slow
def test_reads_are_counted():
    """Each texture by itself, all together, and the light samples by what they must read."""
    camera, params = PLAIN
    night = params.with_(**{"sun.irradiance": (0.0, 0.0, 0.0)})
    quality = nubis.quality("thesis2018")
    kinds = "evaluations", "reads", *counts.TEXTURES
    jobs = [counts.Job(camera, sky, quality, kind) for sky in (params, night) for kind in kinds]
    found = counts.count(jobs, (48, 27))
    day = dict(zip(kinds, found[: len(kinds)], strict=True))
    dark = dict(zip(kinds, found[len(kinds) :], strict=True))
    plain = nubis.Renderer(48, 27, quality=quality).render_layers(camera, params)
    assert (day["evaluations"] == plain["samples"]).all() and plain["samples"].any()
    assert (day["reads"] == sum(day[name] for name in counts.TEXTURES)).all()
    assert (day["weather_map"] == day["evaluations"]).all()
    assert (day["shape_noise"] == day["evaluations"]).all()
    assert (day["curl_noise"] == day["detail_noise"]).all()
    assert not any(day[name].any() for name in ("broad_map", "profile_table"))
    broad = [counts.Job(*FAIR, quality, kind) for kind in ("evaluations", "broad_map")]
    assert np.array_equal(*counts.count(broad, (48, 27)))
    # Five full light samples of four reads and a far one of two at each lit step.
    lit = (day["evaluations"] - dark["evaluations"]) / 6
    assert lit.any() and (day["reads"] - dark["reads"] == 22 * lit).all()


def test_only_the_march_is_counted():
    path = FAIR[1].with_(**{"light.model": "path"})
    with pytest.raises(ValueError, match="march"):
        counts.count([counts.Job(FAIR[0], path, nubis.quality("draft"), "reads")], (8, 8))


def test_what_counts_is_known(tmp_path, monkeypatch):
    """A read that is new in the shaders must be counted, or nothing is."""
    source = tmp_path / "source"
    counts.counting_shaders(source)
    path = source / "density.wgsl"
    with path.open("a") as file:
        file.write("fn more() -> vec4f { return textureSampleLevel(high_map, repeat_sampler, ")
        file.write("vec2f(0.0), 0.0); }\n")
    monkeypatch.setenv("NUBIS_SHADERS", str(source))
    with pytest.raises(ValueError, match="high_map"):
        counts.counting_shaders(tmp_path / "copy")


@pytest.mark.slow
def test_no_optimisation_in_closed_form(panels):
    """Every step of a ray reads 4 texels for itself and 22 for its light: 64 steps straight up,
    128 toward the horizon, and one twice where the way to the first cloud ends.
    """
    camera, _ = FAIR
    width, height = 64, 280
    top = math.tan(math.radians(camera.fov) / 2)
    x, y = np.meshgrid(
        ((np.arange(width) + 0.5) / width * 2 - 1) * top * width / height,
        (1 - (np.arange(height) + 0.5) / height * 2) * top,
    )
    rays = np.asarray(camera.forward) + x[..., None] * camera.right + y[..., None] * camera.up
    up = rays[..., 2] / np.linalg.norm(rays, axis=-1)
    steps = 128 - 64 * up
    reads = panels["no optimisation"]
    assert (np.abs(reads / 26 - steps - 0.5)[up > 0.01] <= 1.001).all()
    assert (reads[up < -0.01] == 0).all() and (up > 0.01).any()


@pytest.mark.slow
def test_no_optimisation_costs_more(panels):
    """At no pixel for those of the thesis but the last, whose steps back may, and in the mean."""
    names = list(panels)
    *exact, big = pairwise(names[:5])
    for before, after in exact:
        assert (panels[after] <= panels[before]).all(), after
        assert panels[after].mean() < panels[before].mean(), after
    assert panels[big[1]].mean() < panels[big[0]].mean()
    for name in "draft", "balanced":
        all_rays, some = (panels[n].mean() for n in names if n.startswith(name))
        assert some < all_rays
        assert (panels[name] == 0).mean() > (panels[f"{name}, a ray for each pixel"] == 0).mean()


@pytest.mark.skipif(not find_spec("matplotlib"), reason="the extra `bench` is not installed")
def test_heat_results(panels, tmp_path, monkeypatch):
    found = [heat.Panel(name, reads) for name, reads in panels.items()]
    monkeypatch.setattr(heat, "panels", lambda *_: found)
    heat.main(["--size", "64x36", "--out", str(tmp_path)])
    results = json.loads((tmp_path / "heat.json").read_text())
    first, *others = results["rows"]
    assert first["share"] == 1 and all(0 < row["share"] < 1 for row in others)
    assert [row["stage"] for row in results["rows"]] == list(panels)
    assert (tmp_path / "plots" / "heat.png").stat().st_size > 10_000
    copy = tmp_path / "speed.md"
    copy.write_text(page.SPEED.read_text())
    page.write_speed(tmp_path, copy)
    assert f"| no optimisation | {first['reads']:.1f} | 100.00 % |" in copy.read_text()


def cells(table):
    """The cells of a table's lines, below its head."""
    lines = [line.strip("|").split("|") for line in table.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line] for line in lines[2:]]


@pytest.mark.slow
def test_profile(tmp_path, capsys):
    path = tmp_path / "profile.json"
    profile.main(["--size", "64x280", "--repeats", "1", "--out", str(path)])
    found = json.loads(path.read_text())
    (frame,) = found["frames"]
    passes, reads, memory = (cells(t) for t in capsys.readouterr().out.split("\n\n") if "---:" in t)
    *parts, (whole, ms, share) = passes
    assert whole == "the frame, by the clock" and share == "100.0 %"
    assert sum(float(row[1]) for row in parts) == pytest.approx(float(ms), abs=0.3)
    assert sum(float(row[2].strip(" %")) for row in parts) == pytest.approx(100, abs=0.3)
    assert {"march_list", "refine", "composite"} <= {row[0] for row in passes}
    assert found["read_ns"].keys() == set(counts.TEXTURES)
    assert all(price > 0 for price in found["read_ns"].values()) and frame["march_ms"] > 0
    *textures, total = reads
    assert sum(float(row[1]) for row in textures) == pytest.approx(float(total[1]), abs=0.3)
    evaluations = nubis.Renderer(64, 280).render_layers(*FAIR)["samples"].mean()
    assert frame["evaluations"] == pytest.approx(evaluations)
    assert [row[1] for row in memory] == [owner for owner, _, _ in frame["memory"]]
    assert sum(int(row[2].replace(" ", "")) for row in memory) == sum(m[2] for m in frame["memory"])


def test_a_frame_without_timestamps():
    """What is not known is left out."""
    frame = {
        "scene": "x", "quality": "draft", "ms": 2.0, "first_ms": 3.0, "passes_ms": {},
        "march_ms": 0, "bakes_ms": {}, "evaluations": 5.0,
        "reads": {"weather_map": 5.0, "broad_map": 0.0},
    }  # fmt: skip
    header = {"size": [8, 8], "adapter": {"kind": "discrete"}}
    text = page.profile({"header": header, "read_ns": None, "frames": [frame]})
    assert "| `weather_map` | 5.0 | – | – |" in text and "broad_map" not in text
    assert "ns each" not in text and "would take" not in text


def held(renderer, owner):
    return {name: size for o, name, size in renderer._core.memory() if o == owner}


def test_memory():
    """What every picture reads is under 64 MB; what grows with the picture is counted apart."""
    renderer = nubis.Renderer(96, 54)
    assert renderer._core.memory() == []
    renderer.render(*FAIR)
    scene, still = held(renderer, "scene"), held(renderer, "still")
    assert sum(scene.values()) < 64e6
    # One half float a texel.
    assert scene["shape_noise"] == 2 * 128**3
    assert scene["weather_map"] == 8 * 512**2
    bytes_a_pixel = {"clouds": 16, "image": 16, "sky": 16, "cloud_span": 8}
    bytes_a_pixel |= {n: 4 for n in ("cloud_depth", "samples", "active_rays", "depth")}
    # Corners of cells of 4 x 4 pixels, and one more around them all: four times four numbers each.
    few = {"ray_count": 16, "corners": 64 * (96 // 4 + 3) * (56 // 4 + 3)}
    assert still == {n: 96 * 54 * b for n, b in bytes_a_pixel.items()} | few
    bigger = nubis.Renderer(192, 108)
    bigger.render(*FAIR)
    # A ray for each pixel and one more, until they are a degree apart.
    assert scene.pop("light_shafts") == 8 * 97 * 55 * 32
    assert (again := held(bigger, "scene")).pop("light_shafts") < 8 * 193 * 109 * 32
    assert again == scene and held(bigger, "still")["sky"] == 4 * still["sky"]
    next(renderer.animate([(*FAIR, 0.0)]))
    assert held(renderer, "animation")["image"] == 16 * 96 * 54
