"""docs/clouds.md and docs/light.md tell the truth: their lines run, and each block of them has its
picture.
"""

import re

import numpy as np
import pytest

import nubis
from docs import gallery

PICTURES = [p for page in gallery.PAGES for p in gallery.pictures(gallery.read(page), page)]


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("picture", PICTURES, ids=lambda picture: picture.name)
def test_lines_make_a_picture(picture):
    frame = picture.shot().frame((32, 18), "draft")
    assert np.isfinite(frame).all() and frame[..., :3].max() > 0
    assert nubis.to_srgb8(frame).std() > 5  # something is to be seen


@pytest.mark.slow
def test_no_two_blocks_make_the_same_picture(renderer):
    shots = [picture.shot() for picture in PICTURES]
    frames = {renderer(16, 9).render(*s[:2], time=s[2]).tobytes() for s in shots}
    assert len(frames) == len(PICTURES)


@pytest.mark.parametrize("page", gallery.PAGES)
def test_every_block_has_its_picture(page):
    text, pictures = gallery.read(page), [p for p in PICTURES if p.page == page]
    assert len(pictures) == len(re.findall(r"^```python$", text, re.M)) >= 8
    links = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)
    assert links == [f"{gallery.folder(page)}/{picture.name}.png" for picture in pictures]
    for picture in pictures:
        assert picture.path.read_bytes().startswith(b"\x89PNG"), f"make gallery: {picture.name}"
    kept = {path.name for path in (gallery.DOCS / gallery.folder(page)).iterdir()}
    assert kept == {picture.path.name for picture in pictures}


LINES = "```python\ncamera, params = nubis.scenes['above']\n```\n"
LINK = "\n![Above](images/clouds/above.png)\n"


def test_the_page_is_read():
    (one,) = gallery.pictures("# Page\n\n" + LINES + LINK)
    assert (one.name, one.line) == ("above", 4)
    assert one.shot() == (*nubis.scenes["above"], 0.0, 0.0, None, None)
    timed = LINES.replace("\n```\n", "\ntime, exposure = 5.0, 1.5\n```\n")
    (one,) = gallery.pictures(timed + LINK)
    assert one.shot()[2:] == (5.0, 1.5, None, None)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (LINES, r":2: no link to images/clouds/NAME.png"),
        (LINES + "\nText." + LINK, ":2: no link"),
        (LINES + LINES + LINK, ":2: no link"),
        (LINES + LINK.replace("clouds/", ""), ":2: no link"),
        (LINES + LINK + "\n" + LINES + LINK, ":8: there are two pictures 'above'"),
    ],
)
def test_a_page_that_is_wrong(text, said):
    with pytest.raises(gallery.PageError, match=said):
        gallery.pictures(text)


def test_lines_that_are_wrong():
    (one,) = gallery.pictures(LINES.replace("params", "sky") + LINK)
    with pytest.raises(gallery.PageError, match=":2: the lines must make a `params`"):
        one.shot()
    (one,) = gallery.pictures("\n\n" + LINES.replace("'above'", "'below'") + LINK)
    with pytest.raises(KeyError) as error:
        one.shot()
    of_page = [
        entry.lineno + 1 for entry in error.traceback if str(entry.path).endswith("clouds.md")
    ]
    assert of_page == [4]


def test_command(tmp_path, capsys):
    name = PICTURES[0].name
    arguments = [name, "--size", "16x9", "--quality", "draft", "--out", str(tmp_path)]
    assert gallery.main(arguments) == 0
    assert [path.name for path in tmp_path.iterdir()] == [f"{name}.png"]
    assert gallery.main(["no_such", "--out", str(tmp_path)]) == 2
    assert name in capsys.readouterr().err
