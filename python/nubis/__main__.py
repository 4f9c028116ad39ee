"""The command line: ``python -m nubis --help``."""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from time import perf_counter
from typing import Literal

import numpy as np

import nubis
from nubis import _image, _nubis

_FORMATS = tuple(ending[1:] for ending in _image.ENDINGS)

_EXAMPLES = """\
examples:
  python -m nubis render sunset
  python -m nubis render --all --size 320x180 --quality draft
  python -m nubis render storm --out storm.exr --time 60 --adapter cpu
  python -m nubis render sunset --preset storm --cover 0.4
  python -m nubis render fair_weather --params my_sky.toml --exposure 0.5
  python -m nubis render in_cloud --heat
"""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m nubis",
        description="Volumetric clouds on any Vulkan device or none.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"nubis {nubis.__version__}")
    commands = parser.add_subparsers(required=True, metavar="command")

    render = commands.add_parser(
        "render",
        help="render scenes into files",
        description="Render scenes into files.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    render.set_defaults(run=_render)
    render.add_argument("scenes", nargs="*", metavar="SCENE", help="see `python -m nubis scenes`")
    render.add_argument("--all", action="store_true", help="render every scene")
    render.add_argument(
        "--out",
        default="out",
        metavar="DIR|FILE",
        help="folder, or file of one scene ending in .png .exr .hdr or .npy (default: out); a new "
        "folder with a dot in its name ends in /",
    )
    render.add_argument(
        "--format",
        choices=_FORMATS,
        help="of files in a folder: png is tone-mapped, the others are linear (default: png)",
    )
    render.add_argument(
        "--size", type=_size, default=(960, 540), metavar="WxH", help="pixels (default: 960x540)"
    )
    render.add_argument(
        "--quality",
        default="balanced",
        metavar="NAME",
        help="numerical method, such as preview, draft, balanced or high (default: balanced)",
    )
    render.add_argument(
        "--adapter",
        metavar="X",
        help="index, kind or part of a name (default: NUBIS_ADAPTER, else the best)",
    )
    render.add_argument(
        "--time", type=float, default=0.0, metavar="S", help="seconds of wind (default: 0)"
    )
    render.add_argument(
        "--exposure",
        type=_exposure,
        default=0.0,
        metavar="E",
        help="stops, or auto, for png (default: 0)",
    )
    clouds = render.add_mutually_exclusive_group()
    clouds.add_argument(
        "--params", type=Path, metavar="FILE", help="TOML file of a sky in place of the scenes' own"
    )
    clouds.add_argument(
        "--preset",
        metavar="NAME",
        help="clouds in place of the scenes' own, under their sun: see `python -m nubis presets`",
    )
    render.add_argument(
        "--cover", type=float, metavar="C", help="how much cloud, from 0, clear, to 1, overcast"
    )
    render.add_argument(
        "--no-dither",
        dest="dither",
        action="store_false",
        help="round each number of a png to the nearest step, without noise against bands",
    )
    render.add_argument(
        "--heat",
        action="store_true",
        help="save beside each picture, as NAME.heat.png, what each of its pixels costs: density "
        "evaluations, black for 0, white for 1000 and more",
    )

    cache = commands.add_parser(
        "cache",
        help="print where baked noise and compiled shaders are kept, or remove them",
        description="Print the folder in which baked noise and compiled shaders are kept for the "
        "next process, and its size. NUBIS_CACHE names another folder; empty, 0 or off, it keeps "
        "nothing.",
    )
    cache.set_defaults(run=_cache)
    cache.add_argument("--clear", action="store_true", help="remove what is in it")

    for run, name, about in [
        (_scenes, "scenes", "list the scenes"),
        (_presets, "presets", "list the presets"),
        (_adapters, "adapters", "list the adapters, best first"),
        (_info, "info", "print versions and adapters, and try a small render"),
    ]:
        command = commands.add_parser(name, help=about, description=about.capitalize() + ".")
        command.set_defaults(run=run)
    return parser


def _exposure(text: str) -> float | Literal["auto"]:
    if text == "auto":
        return "auto"
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a number nor auto") from None


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is no size such as 960x540")
    return int(width), int(height)


def _render(args: argparse.Namespace) -> None:
    targets = _targets(args)
    skies = {name: _sky(args, nubis.scenes[name][1]) for name, _ in targets}
    for _, path in targets:
        path.parent.mkdir(parents=True, exist_ok=True)
        for file in (path, _heat_path(path)) if args.heat else (path,):
            _image.check_target(file)
    renderer = nubis.Renderer(*args.size, quality=args.quality, adapter=args.adapter)
    print(_line(renderer.adapter), flush=True)
    width, height = renderer.size
    with _progress(targets) as bar:
        say = getattr(bar, "write", print)
        for name, path in bar:
            camera, params = nubis.scenes[name][0], skies[name]
            started = perf_counter()
            frame = renderer.render(camera, params, time=args.time)
            milliseconds = 1000 * (perf_counter() - started)
            nubis.save(path, frame, exposure=args.exposure, dither=args.dither)
            say(f"{path}: {renderer.adapter.name}, {width}x{height}, {milliseconds:.0f} ms")
            if args.heat:
                layers = renderer.render_layers(camera, params, time=args.time)
                beside = _heat_path(path)
                _nubis.write_png(beside, _image.heat(layers["samples"]))
                say(f"{beside}: {layers['samples'].mean():.1f} density evaluations a pixel")
            sys.stdout.flush()


def _sky(args: argparse.Namespace, params: nubis.Params) -> nubis.Params:
    """The sky of a scene, or the one that the arguments select instead."""
    if args.params:
        params = nubis.Params.load(args.params)
    elif args.preset is not None:
        params = nubis.sky(preset=args.preset).replace(sun=params.sun)
    return params if args.cover is None else params.with_(**{"clouds.coverage": args.cover})


def _targets(args: argparse.Namespace) -> list[tuple[str, Path]]:
    """Scene names and output files of the arguments."""
    names: list[str] = list(nubis.scenes) if args.all else args.scenes
    if not names:
        known = ", ".join(nubis.scenes)
        raise nubis.ParameterError(f"no scene is given: name some of {known}, or use --all")
    for name in names:
        nubis.scenes[name]  # raises for an unknown name
    out = Path(args.out)
    kind = out.suffix.lower()
    if args.out.endswith(("/", os.sep)) or out.is_dir() or not kind:
        return [(name, out / f"{name}.{args.format or 'png'}") for name in names]
    if kind not in _image.ENDINGS:
        raise nubis.ParameterError(
            f"--out = {args.out!r} is not allowed: a file must end in {' '.join(_image.ENDINGS)}, "
            "and a new folder whose name has a dot in /"
        )
    if args.format and kind != f".{args.format}":
        raise nubis.ParameterError(
            f"--format = {args.format!r} is not allowed: it must be that of --out, {kind[1:]}, or "
            "left out"
        )
    if len(names) > 1:
        raise nubis.ParameterError(
            f"--out = {args.out!r} is not allowed: it must be a folder for more than one scene"
        )
    return [(names[0], out)]


def _heat_path(path: Path) -> Path:
    return path.with_suffix(".heat.png")


def _progress(
    targets: list[tuple[str, Path]],
) -> AbstractContextManager[Iterable[tuple[str, Path]]]:
    """The targets, wrapped in a progress bar if tqdm and a terminal are available."""
    try:
        from tqdm import tqdm
    except ImportError:
        return nullcontext(targets)
    return tqdm(targets, unit="scene", leave=False, disable=None)


def _line(adapter: nubis.Adapter) -> str:
    return f"{adapter.name} ({adapter.kind}, {adapter.backend}, {adapter.driver})"


def _scenes(_: argparse.Namespace) -> None:
    print("\n".join(nubis.scenes))


def _presets(_: argparse.Namespace) -> None:
    print("\n".join(nubis.presets))


def _adapters(_: argparse.Namespace) -> None:
    found = nubis.adapters()
    if not found:
        nubis.Renderer(1, 1)  # raises the error that names a package that helps
    for index, adapter in enumerate(found):
        print(f"{index}: {_line(adapter)}")


def _cache(args: argparse.Namespace) -> None:
    if args.clear:
        _nubis.clear_cache()
    folder, size = _nubis.cache_usage()
    print(f"{folder}: {size / 1e6:.1f} MB" if folder else "off (NUBIS_CACHE)")


def _info(args: argparse.Namespace) -> None:
    python = ".".join(map(str, sys.version_info[:3]))
    print(f"nubis {nubis.__version__}, NumPy {np.__version__}, Python {python} on {sys.platform}")
    _adapters(args)
    renderer = nubis.Renderer(16, 16, quality="draft")
    started = perf_counter()
    frame = renderer.render(*nubis.scenes["fair_weather"])
    if not (np.isfinite(frame).all() and frame[..., :3].max() > 0):
        raise nubis.DeviceError(f"{renderer.adapter.name} rendered a picture that is no sky")
    print(f"test render on {renderer.adapter.name}: ok, {perf_counter() - started:.1f} s")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command. Exit status: 0, 1 internal error, 2 user or file error, 130 Ctrl-C."""
    args = _parser().parse_args(arguments)
    try:
        with warnings.catch_warnings():
            # Redundant: the adapter is printed.
            warnings.filterwarnings("ignore", "no hardware Vulkan adapter")
            args.run(args)
    except KeyboardInterrupt:
        return 130
    except Exception as error:
        mistake = isinstance(error, nubis.NubisError | OSError)
        kind = "" if mistake else f"{type(error).__name__}: "
        print("nubis:", kind + " ".join(str(error).split()), file=sys.stderr)
        return 2 if mistake else 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
