"""The worked examples of CONTRIBUTING.md: their diffs apply, are as short as it says, and do what
it says.
"""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import nubis
from test_style import WIDE, layout_errors, text_of, wide_lines

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "CONTRIBUTING.md"
SECTIONS = ["Adding a parameter", "Adding a pass"]
# What is built of the project is there without being built again, but for our own crates.
BUILT = ROOT / "target" / "release"
OWN = re.compile("clouds|nubis")

pytestmark = pytest.mark.skipif(not shutil.which("git"), reason="there is no git")


def diff_of(section):
    """The one diff under a heading."""
    _, text = PAGE.read_text().split(f"\n## {section}\n")
    diffs = re.findall(r"^```diff\n(.*?)^```", text.split("\n## ")[0], re.MULTILINE | re.DOTALL)
    assert len(diffs) == 1, f"CONTRIBUTING.md, {section}: {len(diffs)} diffs"
    return diffs[0]


def copy_tree(target):
    """What the crates are built from."""
    for name in ("crates", "shaders", "docs"):
        shutil.copytree(ROOT / name, target / name)
    shutil.copytree(ROOT / "python", target / "python", ignore=shutil.ignore_patterns("*.so"))
    for name in ("Cargo.toml", "Cargo.lock", "rust-toolchain.toml"):
        shutil.copy(ROOT / name, target / name)
    return target


def apply(section, tree):
    # A repository around the folder would take the paths for its own.
    environment = os.environ | {"GIT_CEILING_DIRECTORIES": str(tree.parent)}
    done = subprocess.run(
        ["git", "apply", "-"],
        **{"input": diff_of(section), "cwd": tree, "env": environment},
        **{"capture_output": True, "text": True},
    )
    if done.returncode:
        pytest.fail(f"the diff of “{section}” in CONTRIBUTING.md no longer applies:\n{done.stderr}")


def changes(section):
    """Of each file of a diff: whether it is new, and the lines that it adds."""
    files = re.split(r"^--- ", diff_of(section), flags=re.MULTILINE)[1:]
    for text in files:
        old, new, *lines = text.splitlines()
        yield new.removeprefix("+++ b/"), old == "/dev/null", [x for x in lines if x[0] == "+"]


@pytest.mark.parametrize("section", SECTIONS)
def test_a_diff_applies(section, tmp_path):
    """To the tree as it is; and the shaders that it leaves are as all are."""
    tree = copy_tree(tmp_path / "tree")
    apply(section, tree)
    for name, is_new, lines in changes(section):
        text = text_of(tree / name)
        assert is_new or text != text_of(ROOT / name)
        assert all(line[1:] in text for line in lines)
        if name.endswith(".wgsl"):
            allowed = json.loads(WIDE.read_text()).get(name.removeprefix("shaders/wgsl/"), 0)
            assert not layout_errors(text) and len(wide_lines(text)) <= allowed


def test_diffs_are_short():
    """A parameter is a line of code and its use; a pass is two files and four lines."""
    parameter = {name: lines for name, _, lines in changes(SECTIONS[0])}
    code = [x for lines in parameter.values() for x in lines if not x[1:].strip().startswith("//")]
    assert len(parameter) == 2 and len(code) == 2
    files = list(changes(SECTIONS[1]))
    assert sum(is_new for _, is_new, _ in files) <= 2
    assert sum(len(lines) for _, is_new, lines in files if not is_new) <= 4


# Asks for the same as `test_what_the_diffs_make`, which compares.
PROGRAM = """//! Densities with and without billows, and a picture of high clouds: a number a line.

use clouds_core::{Camera, Params, Quality, Renderer, Shot};
use glam::DVec3;

fn main() -> clouds_core::Result<()> {
    let adapter = std::env::var("NUBIS_ADAPTER").ok();
    let mut renderer = Renderer::new(64, 64, Quality::named("draft")?, adapter.as_deref())?;
    let mut params = Params::default();
    let at = |i| [f64::from(i % 64) * 100.0, f64::from(i / 64) * 100.0, 2400.0];
    let points: Vec<_> = (0..4096).map(at).collect();
    for billows in [params.clouds.billows, 0.0] {
        params.clouds.billows = billows;
        let density = renderer.density(&points, &params, 0.0, &|| Ok(()))?;
        density.iter().for_each(|v| println!("{v:e}"));
    }
    let camera = Camera::look_at(DVec3::ZERO, DVec3::new(0.0, 1.0, 1.0), DVec3::Z, 60.0)?;
    (params.sun.elevation, params.sun.azimuth) = (45.0, 0.0);
    (params.clouds.coverage, params.high_clouds.coverage) = (0.0, 1.0);
    let picture = renderer.render(&Shot::new(&camera, &params, 0.0), false, &|| Ok(()))?;
    picture.image.iter().for_each(|v| println!("{v:e}"));
    Ok(())
}
"""
AROUND_THE_SUN = {
    **{"sun.elevation": 45.0, "sun.azimuth": 0.0},
    **{"clouds.coverage": 0.0, "high_clouds.coverage": 1.0},
}


def cargo(tree, *arguments):
    # Our crate alone without optimization, which is most of the time.
    command = ["cargo", arguments[0], "--release", "--offline", "--quiet", *arguments[1:]]
    plain = ["--config", "profile.release.package.clouds_core.opt-level=0"]
    environment = os.environ | {"CARGO_TARGET_DIR": str(tree / "target")}
    done = subprocess.run(
        command + plain, cwd=tree, env=environment, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, f"{' '.join(command)}: {done.stdout}\n{done.stderr}"
    return done.stdout


def link_dependencies(tree):
    """Takes over what the project has built of others' crates, without copying it."""
    if not shutil.which("cargo") or not list(BUILT.glob("deps/libwgpu-*.rlib")):
        pytest.skip("nothing is built: cargo test --release")
    for name in ("deps", "build", ".fingerprint"):
        shutil.copytree(
            *(BUILT / name, tree / "target" / "release" / name),
            copy_function=link_or_copy,
            ignore=lambda _, names: [n for n in names if OWN.search(n)],
        )


def link_or_copy(source, target):
    try:
        os.link(source, target)
    except OSError:  # another file system
        shutil.copy2(source, target)


@pytest.mark.slow
def test_what_the_diffs_make(tmp_path):
    """Both at once: it builds, its generated files and uniforms fit together, and pictures and
    densities are those of the tree but for the ring and where they are asked to differ.
    """
    tree = copy_tree(tmp_path / "tree")
    link_dependencies(tree)
    for section in SECTIONS:
        apply(section, tree)
    examples = tree / "crates" / "clouds_core" / "examples"
    (examples / "worked.rs").write_text(PROGRAM)
    cargo(tree, "run", "--example", "generate")
    assert "billows: float = 10.0" in (tree / "python/nubis/params.py").read_text()
    cargo(tree, "test", "--test", "shaders")
    numbers = np.array(cargo(tree, "run", "--example", "worked").split(), np.float32)
    usual, without, image = np.split(numbers, [4096, 2 * 4096])

    make = nubis.Renderer(64, 64, quality="draft")
    at = np.arange(4096)
    points = np.stack([at % 64 * 100.0, at // 64 * 100.0, np.full(4096, 2400.0)], axis=1)
    np.testing.assert_array_equal(usual, make.density(points, nubis.Params()))
    assert (usual != without).sum() > 100

    camera = nubis.Camera.look_at((0, 0, 0), (0, 1, 1), (0, 0, 1), 60.0)
    before = make.render(camera, nubis.Params().with_(**AROUND_THE_SUN))
    ratio = image.reshape(64, 64, 4)[..., 1] / before[..., 1]
    place = ((np.arange(64) + 0.5) / 32 - 1) * np.tan(np.pi / 6)
    angle = np.degrees(np.arctan(np.hypot(place[:, None], place)))
    np.testing.assert_allclose(ratio[angle < 20], 1, rtol=1e-5)
    assert ratio[(angle > 21.8) & (angle < 22.5)].min() > 1.05
    assert ratio[angle > 30].max() < 1.02
