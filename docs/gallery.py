"""The pictures of docs/clouds.md and docs/light.md, each made by the lines of Python above it.

    python -m docs.gallery                      # all of them, 640x360
    python -m docs.gallery cover storm --size 1280x720 --out /tmp

A block of Python is followed by a link to its picture. It sees `nubis`, and says which `camera` and
`params` are rendered, and, if it likes, at which `time`, with which `exposure` and `quality`. Or it
makes a `sheet`: rows of cameras and parameters, each exposed by itself.
"""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import nubis

DOCS = Path(__file__).parent
PAGES = "clouds", "light"

_BLOCK = re.compile(r"^```python\n(?P<code>.*?)^```\n(?P<after>.*?)(?=^```|^#|\Z)", re.M | re.S)


def folder(page: str) -> str:
    """Where the pictures of a page are, as it links them."""
    return f"images/{page}"


class PageError(nubis.NubisError, ValueError):
    """The page is not as it should be: says in which line."""


class Shot(NamedTuple):
    """What the lines above a picture say.

    Attributes
    ----------
    camera : nubis.Camera
    params : nubis.Params
    time : float
        Seconds.
    exposure : float
        Stops.
    quality : str or None
        The numerical method, where the picture needs one of its own.
    sheet : rows of (camera, params), or None
        Many small pictures in place of one, twice as wide together.
    """

    camera: nubis.Camera
    params: nubis.Params
    time: float = 0.0
    exposure: float = 0.0
    quality: str | None = None
    sheet: Sequence[Sequence[tuple[nubis.Camera, nubis.Params]]] | None = None

    def frame(self, size: tuple[int, int], quality: str) -> npt.NDArray[np.float32]:
        """Render it, with its exposure in it."""
        if self.sheet is None:
            renderer = nubis.Renderer(*size, quality=self.quality or quality)
            frame = renderer.render(self.camera, self.params, time=self.time)
            frame[..., :3] *= 2.0**self.exposure
            return frame
        across = max(2 * size[0] // len(self.sheet[0]), 1)
        renderer = nubis.Renderer(across, max(across * 9 // 16, 1), quality=self.quality or quality)
        rows = []
        for row in self.sheet:
            frames = [renderer.render(camera, params) for camera, params in row]
            for frame in frames:
                frame[..., :3] *= 2.0 ** nubis.auto_exposure(frame)
            rows.append(np.hstack(frames))
        return np.vstack(rows)


@dataclass(frozen=True)
class Picture:
    """A picture of the page.

    Attributes
    ----------
    name : str
        Of its file, without folder and ending.
    code : str
        What makes it.
    line : int
        Where that begins in the page.
    page : str
        Its name, without ending.
    """

    name: str
    code: str
    line: int
    page: str = PAGES[0]

    @property
    def path(self) -> Path:
        """Its file, as the page links it."""
        return DOCS / folder(self.page) / f"{self.name}.png"

    def shot(self) -> Shot:
        """Run the lines."""
        names: dict[str, Any] = {"nubis": nubis}
        # Empty lines in front, so that a mistake is found where it is.
        page = DOCS / f"{self.page}.md"
        exec(compile("\n" * (self.line - 1) + self.code, str(page), "exec"), names)
        if "sheet" in names:
            names["camera"], names["params"] = names["sheet"][0][0]
        for name, kind in (("camera", nubis.Camera), ("params", nubis.Params)):
            if not isinstance(names.get(name), kind):
                raise PageError(f"{page.name}:{self.line}: the lines must make a `{name}`")
        return Shot(**{name: names[name] for name in Shot._fields if name in names})


def pictures(text: str, page: str = PAGES[0]) -> list[Picture]:
    """Return the pictures of a page, in order; `PageError` for a block that has none."""
    file = f"{page}.md"
    linked = re.compile(rf"\s*!\[[^\]]+\]\({folder(page)}/(?P<name>\w+)\.png\)")
    found: dict[str, Picture] = {}
    for block in _BLOCK.finditer(text):
        line = text.count("\n", 0, block.start("code")) + 1
        link = linked.match(block["after"])
        if not link:
            raise PageError(f"{file}:{line}: no link to {folder(page)}/NAME.png follows the lines")
        if link["name"] in found:
            raise PageError(f"{file}:{line}: there are two pictures {link['name']!r}")
        found[link["name"]] = Picture(link["name"], block["code"], line, page)
    return list(found.values())


def read(page: str) -> str:
    """The text of a page."""
    return (DOCS / f"{page}.md").read_text(encoding="utf-8")


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is no size such as 640x360")
    return int(width), int(height)


def main(arguments: Sequence[str] | None = None) -> int:
    """Render the pictures that are named, or all; return 0, or 2 after a mistake."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.gallery",
        description="Render the pictures of docs/clouds.md and docs/light.md.",
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="pictures (default: all)")
    parser.add_argument("--size", type=_size, default=(640, 360), metavar="WxH", help="640x360")
    parser.add_argument(
        "--quality",
        default="balanced",
        help="where a picture names none (balanced)",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder (docs/images/PAGE)")
    args = parser.parse_args(arguments)
    try:
        found = [picture for page in PAGES for picture in pictures(read(page), page)]
        known = [picture.name for picture in found]
        for name in args.names:
            if name not in known:
                raise PageError(f"there is no picture {name!r}, only {', '.join(known)}")
        warnings.filterwarnings("ignore", "no hardware Vulkan adapter")
        for picture in found:
            if args.names and picture.name not in args.names:
                continue
            path = args.out / f"{picture.name}.png" if args.out else picture.path
            path.parent.mkdir(parents=True, exist_ok=True)
            nubis.save(path, picture.shot().frame(args.size, args.quality))
            print(path, flush=True)
    except (nubis.NubisError, OSError) as error:
        print("gallery:", error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
