"""Base classes of all parameter classes: validation, comparison, replacement, files."""

from __future__ import annotations

import dataclasses
import io
import math
import os
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from nubis import _nubis
from nubis._errors import FileError, ParameterError
from nubis._names import RENAMED, current_names, refuse_arguments, unknown_field
from nubis._nubis import DensityGrid


class _Renaming(type):
    """Class whose constructor takes deprecated names of fields."""

    if not TYPE_CHECKING:

        def __call__(cls, *args: Any, **given: Any) -> Any:
            return super().__call__(*args, **current_names(given))


class Base(metaclass=_Renaming):
    """A frozen dataclass with comparison and hash by value, arrays included."""

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]

    def __new__(cls, *_: Any, **given: Any) -> Self:
        # Before the `__init__` of the dataclass, whose error does not list the fields.
        refuse_arguments(cls.__name__, given, cls.__dataclass_fields__)
        return super().__new__(cls)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed.

        Raises
        ------
        ParameterError
            For an unknown field, or a value that is not allowed.

        Examples
        --------
        >>> sun = nubis.Sun().replace(elevation=5.0)
        """
        names = [f.name for f in dataclasses.fields(self)]
        changes = current_names(changes)
        for name, value in changes.items():
            if name not in names:
                raise _unknown(f"{type(self).__name__}.{name}", value, names)
        return dataclasses.replace(self, **changes)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            # Only for names that are no attribute.
            if RENAMED.get(name) in self.__dataclass_fields__:
                return getattr(self, next(iter(current_names({name: None}))))
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")

    def _key(self) -> tuple[Any, ...]:
        values = (getattr(self, f.name) for f in dataclasses.fields(self))
        return tuple((v.shape, v.tobytes()) if isinstance(v, np.ndarray) else v for v in values)

    def __setstate__(self, state: dict[str, Any]) -> None:
        # A pickle of another version may have further fields.
        state = {RENAMED.get(name, name): value for name, value in state.items()}
        names = [f.name for f in dataclasses.fields(self)]
        for name, value in state.items():
            if name not in names:
                raise _unknown(f"{type(self).__name__}.{name}", value, names)
        # Copied and unpickled arrays are writeable.
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
    """A group of parameters. Every value is validated on construction."""

    def __post_init__(self) -> None:
        name = type(self).__name__
        path = "".join("_" + c.lower() if c.isupper() else c for c in name).lstrip("_")
        for field in dataclasses.fields(self):
            value = _nubis.check(name, path, field.name, getattr(self, field.name))
            object.__setattr__(self, field.name, value)

    def to_dict(self) -> dict[str, Any]:
        """Return built-in Python values by field name; arrays become nested lists."""
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return {
            k: v.tolist() if isinstance(v, np.ndarray) else list(v) if isinstance(v, tuple) else v
            for k, v in values.items()
        }


class Root(Base):
    """Base class of `Params`: all groups of parameters."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            wanted = field.default_factory
            if field.name == "weather_mix":
                object.__setattr__(self, field.name, _mixture(value))
                continue
            if field.default is None:  # the optional group: the volume
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
        """Return a copy with fields of groups changed, by dotted names.

        Raises
        ------
        ParameterError
            For an unknown field, or a value that is not allowed.

        Examples
        --------
        >>> params = nubis.Params().with_(**{"clouds.coverage": 0.7, "sun.elevation": 20.0})
        """
        changes = current_names(changes)
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

    def after(self, before: Self, time: float) -> Self:
        """Return this sky with a `drift` that continues the motion of another sky.

        Clouds do not jump when the winds change: at `time` everything that winds carry is at its
        position in `before`, and the winds of this sky carry it from there. Only `drift` differs
        between this sky and the result. `drift` is computed in float64, so that a picture a month
        later is as exact as the first. The result holds for any time; before `time` it
        extrapolates the new winds backward, so use `before` there.

        Parameters
        ----------
        before : Params
            The sky up to `time`.
        time : float
            Time of the change of wind in seconds, as for `Renderer.render`.

        Returns
        -------
        Params

        Raises
        ------
        ParameterError
            If `before` is no `Params` or `time` is not finite.

        Examples
        --------
        >>> breeze = nubis.Params()
        >>> gale = breeze.with_(**{"wind.speed": 25.0}).after(breeze, 3600.0)
        >>> skies = [breeze if time < 3600 else gale for time in range(0, 7200, 60)]
        """
        if type(before) is not type(self):
            raise ParameterError(f"before = {before!r} is not allowed: it must be a nubis.Params")
        when = _nubis.number("time", time)
        if not math.isfinite(when):
            raise ParameterError(f"time = {time!r} is not allowed: it must be a finite number")
        return self.with_(
            **{f"drift.{n}": v for n, v in _nubis.drift_after(self, before, when).items()}
        )

    def to_dict(self) -> dict[str, Any]:
        """Return built-in Python values by group and field name; arrays become nested lists.

        ``weather_mix`` becomes a list of weathers, each with its ``weight``.
        """
        groups = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        mixture = groups.pop("weather_mix", ())
        values = {name: group.to_dict() for name, group in groups.items() if group is not None}
        if mixture:
            values["weather_mix"] = [{"weight": w, **weather.to_dict()} for weather, w in mixture]
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Return parameters from the result of `to_dict`; missing fields have their defaults.

        Raises
        ------
        ParameterError
            For an unknown field, or a value that is not allowed.

        Examples
        --------
        >>> params = nubis.Params.from_dict({"clouds": {"coverage": 0.7}})
        """
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
                changes[f"{block}.{name}"] = value
        # Last: a mixture is validated against `weather`.
        return cls().with_(**changes).replace(**whole)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all parameters to a TOML file.

        Arrays of more than 4096 numbers are written to ``<file>.<group>.<field>.<checksum>.npy`` in
        the same folder, and the TOML file refers to them by name: move the files together. Arrays
        of earlier versions of the file are kept, because copies of the file may refer to them.
        Writing is atomic: each file is written under a temporary name and renamed when complete,
        the TOML file last.

        Raises
        ------
        FileError
            If a file cannot be written.

        Examples
        --------
        >>> params.save("sky.toml")
        >>> nubis.Params.load("sky.toml") == params
        True
        """
        import tomli_w  # here, as `tomllib` below, to keep `import nubis` fast

        target = Path(path)

        def given(name: str, group: Any) -> dict[str, Any]:
            fields = {k: v for k, v in group.to_dict().items() if v is not None}
            for field in fields:
                value = getattr(group, field, None)
                if isinstance(value, np.ndarray) and value.size > _LONGEST_INSIDE:
                    fields[field] = _write_beside(target, f"{name}.{field}", value)
            return fields

        tables: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            group = getattr(self, field.name)
            if field.name == "weather_mix":
                if group:
                    tables[field.name] = [
                        {"weight": weight, **given(f"weather_mix{i}", weather)}
                        for i, (weather, weight) in enumerate(group)
                    ]
            elif group is not None:
                tables[field.name] = given(field.name, group)
        _nubis.write_bytes(target, tomli_w.dumps(tables).encode())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read parameters from a TOML file; missing fields have their defaults.

        An array is given as nested lists, or as the name of a ``.npy`` file in the folder of the
        TOML file.

        Raises
        ------
        ParameterError
            If the file is not TOML, a field is unknown, or a value is not allowed.
        FileError
            If a ``.npy`` file cannot be read.
        OSError
            If the TOML file cannot be read.

        Examples
        --------
        >>> params = nubis.Params.load("sky.toml")
        """
        import tomllib

        source = Path(path)
        try:
            # Editors on Windows may write a byte-order mark.
            values = tomllib.loads(source.read_bytes().decode("utf-8-sig"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ParameterError(
                f"path = {os.fspath(path)!r} is not allowed: it must be a TOML file ({error})"
            ) from error
        return cls.from_dict({k: _with_arrays(source, k, v) for k, v in values.items()})


# Largest number of elements of an array that is written into the TOML file itself.
_LONGEST_INSIDE = 4096


def _write_beside(target: Path, field: str, array: np.ndarray[Any, Any]) -> str:
    """Write an array of the file `target`; return its name, which holds its checksum."""
    out = io.BytesIO()
    np.save(out, array, allow_pickle=False)
    content = out.getvalue()
    beside = target.with_name(f"{target.name}.{field}.{zlib.crc32(content):08x}.npy")
    _nubis.write_bytes(beside, content)
    return beside.name


def _with_arrays(source: Path, name: str, value: Any) -> Any:
    """A value of the file `source`, with names of ``.npy`` files replaced by their arrays."""
    if isinstance(value, Mapping):
        return {k: _with_arrays(source, f"{name}.{k}", v) for k, v in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        return [_with_arrays(source, f"{name}[{i}]", v) for i, v in enumerate(value)]
    if not (isinstance(value, str) and value.endswith(".npy")):
        return value
    try:
        array = np.load(source.parent / value, allow_pickle=False)
    except OSError as error:
        raise FileError(f"{name} = {value!r} cannot be read: {error}") from error
    except (ValueError, EOFError) as error:
        raise ParameterError(
            f"{name} = {value!r} is not allowed: it must be a file that numpy.save has written "
            f"({error})"
        ) from error
    return array


def _mixture(value: Any) -> tuple[tuple[Block, float], ...]:
    from nubis.params import Weather  # here: params.py imports this module

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
        fields = {n: v for n, v in table.items() if n != "weight"}
        mixture.append((Weather(**fields), table["weight"]))
    return mixture


def _grid(fields: Mapping[str, Any]) -> DensityGrid:
    names = ["extinction", "bounds"]
    for name, value in fields.items():
        if name not in names:
            raise _unknown(f"volume.{name}", value, names)
    for name in names:
        if name not in fields:
            raise ParameterError(f"volume.{name} is missing: a volume has {' and '.join(names)}")
    return DensityGrid(fields["extinction"], fields["bounds"])


def _unknown(path: str, value: Any, names: list[str]) -> ParameterError:
    return ParameterError(unknown_field(f"{path} = {value!r}", path, names))
