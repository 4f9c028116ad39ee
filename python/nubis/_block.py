"""What all parameter classes share: checking, comparing, replacing, and files."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from nubis import _nubis
from nubis._errors import ParameterError
from nubis._nubis import DensityGrid


class Base:
    """A frozen dataclass that compares by value, arrays included."""

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed."""
        names = [f.name for f in dataclasses.fields(self)]
        for name, value in changes.items():
            if name not in names:
                raise _unknown(f"{type(self).__name__}.{name}", value, names)
        return dataclasses.replace(self, **changes)

    def _key(self) -> tuple[Any, ...]:
        values = (getattr(self, f.name) for f in dataclasses.fields(self))
        return tuple((v.shape, v.tobytes()) if isinstance(v, np.ndarray) else v for v in values)

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Of another version there may be more.
        names = [f.name for f in dataclasses.fields(self)]
        for name, value in state.items():
            if name not in names:
                raise _unknown(f"{type(self).__name__}.{name}", value, names)
        # Copies and pickles of arrays come writeable.
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        self.__dict__.update(state)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash((type(self).__name__, self._key()))


class Block(Base):
    """A group of parameters. Every value is checked when it is made."""

    def __post_init__(self) -> None:
        name = type(self).__name__
        path = "".join("_" + c.lower() if c.isupper() else c for c in name).lstrip("_")
        for field in dataclasses.fields(self):
            value = _nubis.check(name, path, field.name, getattr(self, field.name))
            object.__setattr__(self, field.name, value)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values by field name; arrays as nested lists."""
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return {
            k: v.tolist() if isinstance(v, np.ndarray) else list(v) if isinstance(v, tuple) else v
            for k, v in values.items()
        }


class Root(Base):
    """All groups of parameters together."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            wanted = field.default_factory
            if field.name == "weather_mix":
                object.__setattr__(self, field.name, _mixture(value))
                continue
            if field.default is None:  # A group that may be missing: the volume.
                fits = value is None or isinstance(value, DensityGrid)
                allowed = "DensityGrid or None"
            else:
                fits = isinstance(wanted, type) and isinstance(value, wanted)
                allowed = getattr(wanted, "__name__", "?")
            if not fits:
                raise ParameterError(
                    f"{field.name} = {value!r} is not allowed: it must be a nubis.{allowed}"
                )
        _nubis.check_params(self)

    def with_(self, **changes: Any) -> Self:
        """Return a copy with deep fields changed: ``with_(**{"clouds.coverage": 0.7})``."""
        blocks: dict[str, dict[str, Any]] = {}
        groups = [f.name for f in dataclasses.fields(self)]
        for path, value in changes.items():
            block, _, name = path.partition(".")
            if block not in groups or not name:
                raise _unknown(path, value, [f"{group}.<field>" for group in groups])
            blocks.setdefault(block, {})[name] = value
        new = {}
        for block, fields in blocks.items():
            old = getattr(self, block)
            if not isinstance(old, Block):
                path, value = next(iter(fields.items()))
                raise ParameterError(
                    f"{block}.{path} = {value!r} is not allowed: replace({block}=...) sets it whole"
                )
            names = [f.name for f in dataclasses.fields(old)]
            for name, value in fields.items():
                if name not in names:
                    raise _unknown(f"{block}.{name}", value, [f"{block}.{n}" for n in names])
            new[block] = old.replace(**fields)
        return self.replace(**new)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values by group and field name; arrays as nested lists.

        A mixture of weathers is a list of their values, each with its ``weight``.
        """
        groups = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        mixture = groups.pop("weather_mix", ())
        values = {name: group.to_dict() for name, group in groups.items() if group is not None}
        if mixture:
            values["weather_mix"] = [{"weight": w, **weather.to_dict()} for weather, w in mixture]
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Make parameters from what `to_dict` returned; fields left out have their defaults."""
        if not isinstance(values, Mapping):
            raise ParameterError(f"values = {values!r} is not allowed: it must be a mapping")
        changes = {}
        whole: dict[str, Any] = {}
        for block, fields in values.items():
            if block == "weather_mix":
                whole[block] = _mixture_from_tables(fields)
                continue
            if not isinstance(fields, Mapping):
                raise ParameterError(f"{block} = {fields!r} is not allowed: it must be a table")
            if block == "volume":
                whole[block] = _grid(fields)
                continue
            for name, value in fields.items():
                changes[f"{block}.{name}"] = _plain(block, name, value)
        # Last, since a mixture must fit the weather that it goes with.
        return cls().with_(**changes).replace(**whole)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all parameters to a TOML file."""
        import tomli_w  # here, as `tomllib` below: a first picture need not wait for them

        def given(fields: dict[str, Any]) -> dict[str, Any]:
            return {name: value for name, value in fields.items() if value is not None}

        tables = {
            block: [given(f) for f in fields] if isinstance(fields, list) else given(fields)
            for block, fields in self.to_dict().items()
        }
        Path(path).write_text(tomli_w.dumps(tables), encoding="utf-8")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read parameters from a TOML file; fields left out have their defaults."""
        import tomllib

        try:
            values = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ParameterError(
                f"path = {os.fspath(path)!r} is not allowed: it must be a TOML file ({error})"
            ) from error
        return cls.from_dict(values)


def _plain(block: str, name: str, value: Any) -> Any:
    deep = isinstance(value, list) and value and isinstance(value[0], list)
    return _array(block, name, value) if deep else value


def _mixture(value: Any) -> tuple[tuple[Block, float], ...]:
    from nubis.params import Weather  # which imports this

    allowed = "a tuple of pairs (nubis.Weather, weight from 0 to 1)"
    try:
        pairs = [(weather, weight) for weather, weight in value]
    except (TypeError, ValueError):
        raise ParameterError(
            f"weather_mix = {value!r} is not allowed: it must be {allowed}"
        ) from None
    for index, (weather, _) in enumerate(pairs):
        if not isinstance(weather, Weather):
            raise ParameterError(
                f"weather_mix[{index}] = {weather!r} is not allowed: it must be a nubis.Weather"
            )
    return tuple(
        (weather, _nubis.number(f"weather_mix[{i}] weight", w))
        for i, (weather, w) in enumerate(pairs)
    )


def _mixture_from_tables(tables: Any) -> Sequence[tuple[Block, Any]]:
    from nubis.params import Weather

    mixture = []
    if not isinstance(tables, list | tuple):
        raise ParameterError(
            f"weather_mix = {tables!r} is not allowed: it must be a list of tables"
        )
    for index, table in enumerate(tables):
        path = f"weather_mix[{index}]"
        if not isinstance(table, Mapping):
            raise ParameterError(f"{path} = {table!r} is not allowed: it must be a table")
        if "weight" not in table:
            raise ParameterError(f"{path}.weight is missing: a weather of a mixture has a weight")
        names = [f.name for f in dataclasses.fields(Weather)]
        for name, value in table.items():
            if name not in (*names, "weight"):
                raise _unknown(f"{path}.{name}", value, ["weight", *names])
        fields = {n: _plain(path, n, v) for n, v in table.items() if n != "weight"}
        mixture.append((Weather(**fields), table["weight"]))
    return mixture


def _array(block: str, name: str, value: list[Any]) -> np.ndarray[Any, Any]:
    try:
        return np.array(value, dtype=np.float32)
    except (TypeError, ValueError) as error:
        raise ParameterError(
            f"{block}.{name} = (nested lists) is not allowed: they must form an array ({error})"
        ) from error


def _grid(fields: Mapping[str, Any]) -> DensityGrid:
    names = ["extinction", "bounds"]
    for name, value in fields.items():
        if name not in names:
            raise _unknown(f"volume.{name}", value, names)
    for name in names:
        if name not in fields:
            raise ParameterError(f"volume.{name} is missing: a volume has {' and '.join(names)}")
    return DensityGrid(_array("volume", "extinction", fields["extinction"]), fields["bounds"])


# Fields that there are no more, and why.
GONE = {"view_distance": "clouds are drawn to the horizon from any altitude"}


def _unknown(path: str, value: Any, names: list[str]) -> ParameterError:
    gone = GONE.get(path.rpartition(".")[2])
    why = f"{gone}, and there is no such field" if gone else "there is no such field"
    return ParameterError(f"{path} = {value!r} is not allowed: {why}, only {', '.join(names)}")
