"""Style that no formatter holds up: the layout of WGSL files, constants that are copied, the
version of Rust, tiers of tests.

`UPDATE=1 pytest tests/test_style.py` lowers the numbers of wide_lines.json to what is there.
"""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SHADERS = ROOT / "shaders" / "wgsl"
FILES = sorted(SHADERS.rglob("*.wgsl"))
RUST = sorted((ROOT / "crates").rglob("*.rs"))
WIDTH = tomllib.loads((ROOT / "rustfmt.toml").read_text())["max_width"]
# Lines of each file that are wider than WIDTH. Numbers only fall; a new file has none.
WIDE = Path(__file__).parent / "wide_lines.json"


def text_of(path):
    return path.read_bytes().decode()


def layout_errors(text):
    """What is wrong with the layout of a WGSL file, with numbers of lines."""
    lines = text.split("\n")
    marks = {
        "a tab": re.compile(r"\t"),
        "spaces at the end": re.compile(r" $"),
        "a carriage return": re.compile(r"\r"),
    }
    errors = [
        f"line {number} has {what}"
        for number, line in enumerate(lines, start=1)
        for what, mark in marks.items()
        if mark.search(line)
    ]
    if not re.match(r"// \S", text):
        errors.append("line 1 is no comment that says what the file computes")
    if not text.endswith("\n") or text.endswith("\n\n"):
        errors.append("the file does not end in one newline")
    return errors


def wide_lines(text):
    return [n for n, line in enumerate(text.split("\n"), start=1) if len(line) > WIDTH]


def test_there_are_shaders():
    assert len(FILES) > 10


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(SHADERS).as_posix())
def test_layout(path):
    assert not layout_errors(text_of(path))


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("// Light.\n\tx\n", "line 2 has a tab"),
        ("// Light.\nx \n", "line 2 has spaces at the end"),
        ("// Light.\r\n", "line 1 has a carriage return"),
        ("x\n", "line 1 is no comment that says what the file computes"),
        ("//\n", "line 1 is no comment that says what the file computes"),
        ("// Light.", "the file does not end in one newline"),
        ("// Light.\n\n", "the file does not end in one newline"),
    ],
)
def test_layout_errors(text, error):
    assert layout_errors(text) == [error]
    assert not layout_errors("// Light.\nfn light() {}\n")


def test_width():
    """No file has more wide lines than it is allowed, and what it no longer needs is taken away."""
    wide = {p.relative_to(SHADERS).as_posix(): wide_lines(text_of(p)) for p in FILES}
    allowed = json.loads(WIDE.read_text())
    too_wide = {f: lines for f, lines in wide.items() if len(lines) > allowed.get(f, 0)}
    assert not too_wide, f"more lines than before are wider than {WIDTH}"
    left = {f: len(lines) for f, lines in wide.items() if lines}
    if os.environ.get("UPDATE"):
        WIDE.write_text(json.dumps(left, indent=4) + "\n")
    elif left != allowed:
        pytest.fail("fewer lines are wide: UPDATE=1 pytest tests/test_style.py")


def test_width_counts_characters():
    assert wide_lines("x\n" + "é" * WIDTH + "\n" + "é" * (WIDTH + 1)) == [3]


def copied(text):
    """What comments say to be as it is in another file, of Rust or WGSL."""
    joined = re.sub(r"\s+(?://[/!]?)?\s*", " ", text)
    return re.findall(r"\bas in `?[\w/]+\.(?:rs|wgsl)\b", joined, re.IGNORECASE)


@pytest.mark.parametrize("path", FILES + RUST, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_copies(path):
    """What Rust and WGSL share is declared once (crates/clouds_core/src/shared.rs)."""
    assert not copied(text_of(path))


def test_copies_are_found():
    for comment in (
        "const A = 4u; // as in a.rs\n",
        "// As in `passes/a.wgsl`.\n",
        "/// as\n/// in a.rs).\n",
    ):
        assert len(copied(comment)) == 1, comment
    assert not copied("// As color.rs does, in 8 bits (a.rs), as in passes/march.\n")


def test_one_version_of_rust():
    """The toolchain that is pinned is the oldest that Cargo.toml allows."""
    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text())
    pinned = tomllib.loads((ROOT / "rust-toolchain.toml").read_text())
    oldest = cargo["workspace"]["package"]["rust-version"]
    assert re.fullmatch(re.escape(oldest) + r"\.\d+", pinned["toolchain"]["channel"])


@pytest.mark.slow
def test_the_first_tier_has_a_test_of_each_file():
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-m", "not slow"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    guarded = {line.split("::")[0] for line in done.stdout.splitlines() if "::" in line}
    assert guarded == {f"tests/{path.name}" for path in Path(__file__).parent.glob("test_*.py")}
