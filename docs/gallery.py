"""The pictures of docs/clouds.md, each made by the lines of Python above it.

    python -m docs.gallery                      # all of them, 640x360
    python -m docs.gallery cover storm --size 1280x720 --out /tmp

A block of Python is followed by a link to its picture. It sees `nubis`, and says which `camera` and
`params` are rendered, and, if it likes, at which `time`, with which `exposure` and `quality`.
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

import nubis

PAGE = Path(__file__).parent / "clouds.md"
#: Where the pictures are, as the page links them.
FOLDER = "images/clouds"

_BLOCK = re.compile(r"^```python\n(?P<code>.*?)^```\n(?P<after>.*?)(?=^```|^#|\Z)", re.M | re.S)
_LINK = re.compile(rf"\s*!\[[^\]]+\]\({FOLDER}/(?P<name>\w+)\.png\)")


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
    """

    camera: nubis.Camera
    params: nubis.Params
    time: float = 0.0
    exposure: float = 0.0
    quality: str | None = None


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
    """

    name: str
    code: str
    line: int

    @property
    def path(self) -> Path:
        """Its file, as the page links it."""
        return PAGE.parent / FOLDER / f"{self.name}.png"

    def shot(self) -> Shot:
        """Run the lines."""
        names: dict[str, Any] = {"nubis": nubis}
        # Empty lines in front, so that a mistake is found where it is.
        exec(compile("\n" * (self.line - 1) + self.code, str(PAGE), "exec"), names)
        for name, kind in (("camera", nubis.Camera), ("params", nubis.Params)):
            if not isinstance(names.get(name), kind):
                raise PageError(f"{PAGE.name}:{self.line}: the lines must make a `{name}`")
        return Shot(**{name: names[name] for name in Shot._fields if name in names})


def pictures(text: str) -> list[Picture]:
    """Return the pictures of a page, in order; `PageError` for a block that has none."""
    found: dict[str, Picture] = {}
    for block in _BLOCK.finditer(text):
        line = text.count("\n", 0, block.start("code")) + 1
        link = _LINK.match(block["after"])
        if not link:
            raise PageError(f"{PAGE.name}:{line}: no link to {FOLDER}/NAME.png follows the lines")
        if link["name"] in found:
            raise PageError(f"{PAGE.name}:{line}: there are two pictures {link['name']!r}")
        found[link["name"]] = Picture(link["name"], block["code"], line)
    return list(found.values())


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is no size such as 640x360")
    return int(width), int(height)


def main(arguments: Sequence[str] | None = None) -> int:
    """Render the pictures that are named, or all; return 0, or 2 after a mistake."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.gallery", description="Render the pictures of docs/clouds.md."
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="pictures (default: all)")
    parser.add_argument("--size", type=_size, default=(640, 360), metavar="WxH", help="640x360")
    parser.add_argument(
        "--quality",
        default="balanced",
        help="where a picture names none (balanced)",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help=f"folder (docs/{FOLDER})")
    args = parser.parse_args(arguments)
    try:
        page = pictures(PAGE.read_text(encoding="utf-8"))
        known = [picture.name for picture in page]
        for name in args.names:
            if name not in known:
                raise PageError(f"there is no picture {name!r}, only {', '.join(known)}")
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "no hardware Vulkan adapter")
            usual = nubis.Renderer(*args.size, quality=args.quality)
        for picture in page:
            if args.names and picture.name not in args.names:
                continue
            shot = picture.shot()
            own = nubis.Renderer(*args.size, quality=shot.quality) if shot.quality else usual
            path = args.out / f"{picture.name}.png" if args.out else picture.path
            path.parent.mkdir(parents=True, exist_ok=True)
            frame = own.render(shot.camera, shot.params, time=shot.time)
            nubis.save(path, frame, exposure=shot.exposure)
            print(path, flush=True)
    except (nubis.NubisError, OSError) as error:
        print("gallery:", error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
