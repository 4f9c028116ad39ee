"""What is written about the package holds: examples run, code in the README names what exists,
paths are there.
"""

import ast
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import nubis

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def code_blocks(path):
    return re.findall(r"^```python\n(.*?)^```", path.read_text(), flags=re.MULTILINE | re.DOTALL)


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCKS = [
    pytest.param(code, id=f"{page.name}-{i}")
    for page in PAGES
    for i, code in enumerate(code_blocks(page), start=1)
]


def dotted(node):
    """The names of `a.b.c`, or nothing where it hangs on something else."""
    if isinstance(node, ast.Name):
        return [node.id]
    if isinstance(node, ast.Attribute) and (head := dotted(node.value)):
        return [*head, node.attr]
    return []


@pytest.mark.parametrize("code", BLOCKS)
def test_code_in_pages(code):
    """It compiles; the names of nubis that it uses exist, and take the arguments that they are
    called with.
    """
    tree = ast.parse(code)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and (names := dotted(node)) and names[0] == "nubis":
            value = nubis
            for name in names[1:]:
                value = getattr(value, name)
        if isinstance(node, ast.Call) and (names := dotted(node.func)) and names[0] == "nubis":
            value = nubis
            for name in names[1:]:
                value = getattr(value, name)
            named = {keyword.arg: None for keyword in node.keywords if keyword.arg}
            if not any(isinstance(a, ast.Starred) for a in node.args) and None not in [
                k.arg for k in node.keywords
            ]:
                inspect.signature(value).bind(*node.args, **named)


def test_paths_in_the_architecture():
    page = ROOT / "ARCHITECTURE.md"
    if not page.exists():
        pytest.skip("there is no ARCHITECTURE.md")
    quoted = re.findall(r"`([^`\n]+)`", page.read_text())
    paths = [
        q for q in quoted if re.fullmatch(r"[\w.-]+(/[\w.*{}-]+)*/?", q) and ("/" in q or "." in q)
    ]
    tops = {p.name for p in ROOT.iterdir()}
    paths = [q for q in paths if q.split("/")[0] in tops]
    assert paths
    missing = [q for q in paths if not any(ROOT.glob(q.rstrip("/")))]
    assert not missing


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example, tmp_path):
    """It says what it shows, and runs from anywhere."""
    assert ast.get_docstring(ast.parse(example.read_text()))
    done = subprocess.run(
        [sys.executable, "-W", "error", example],
        cwd=tmp_path,
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        timeout=120,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_there_are_examples():
    assert EXAMPLES
