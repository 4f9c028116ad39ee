"""Measured methods: named qualities, and families of methods that differ in one setting."""

from __future__ import annotations

from dataclasses import dataclass

import nubis

PRESETS = "draft", "balanced", "high", "nubis2015", "thesis2018", "vsu2022"


@dataclass(frozen=True, kw_only=True)
class Method:
    """A numerical method; the resolution is divided by `divisor`."""

    name: str
    family: str
    value: int  # of the setting of the family
    quality: nubis.Quality
    divisor: int = 1


def _view_steps(base: str, horizon: int) -> Method:
    old = nubis.quality(base)
    zenith = max(1, round(horizon * old.steps_zenith / old.steps_horizon))
    quality = old.replace(steps_zenith=zenith, steps_horizon=horizon)
    family = f"{base}: view steps"
    return Method(name=f"{family} {horizon}", family=family, value=horizon, quality=quality)


def _light_steps(base: str, count: int) -> Method:
    family = f"{base}: light steps"
    quality = nubis.quality(base).replace(light_steps=count)
    return Method(name=f"{family} {count}", family=family, value=count, quality=quality)


def _resolution(base: str, divisor: int) -> Method:
    family = f"{base}: resolution"
    return Method(
        name=f"{family} 1/{divisor}",
        family=family,
        value=divisor,
        quality=nubis.quality(base),
        divisor=divisor,
    )


def full() -> list[Method]:
    """All methods. Members of a family are in order from coarse to fine."""
    found = [Method(name=p, family=p, value=0, quality=nubis.quality(p)) for p in PRESETS]
    found += [_view_steps("balanced", n) for n in (20, 40, 80, 160, 320, 640, 1280)]
    found += [_view_steps("high", n) for n in (32, 64, 128, 256, 512)]
    found += [_light_steps("balanced", n) for n in (1, 2, 4, 8, 16, 32, 64)]
    found += [_light_steps("high", n) for n in (1, 2, 4, 8, 16, 32)]
    found += [_resolution(base, n) for base in ("balanced", "high") for n in (4, 3, 2, 1)]
    return found


def quick() -> list[Method]:
    """A small selection of methods, as a smoke test."""
    found = [Method(name=p, family=p, value=0, quality=nubis.quality(p)) for p in PRESETS[:2]]
    found += [_view_steps("draft", n) for n in (24, 96)]
    found += [_light_steps("draft", n) for n in (1, 5)]
    found += [_resolution("draft", n) for n in (4, 2, 1)]
    return found
