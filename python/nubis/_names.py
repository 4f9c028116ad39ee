"""Error messages for unknown names: the closest match and all names that exist."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

from nubis import _nubis
from nubis._errors import ParameterError

Value = TypeVar("Value")

# Removed fields, and the reason.
GONE = {
    "sun_volume": 'nubis.quality("balanced") takes less time and, but for storms, errs less',
    "view_distance": "clouds are drawn to the horizon from any altitude",
}


# Deprecated names of blocks and fields, and their names now.
RENAMED: dict[str, str] = _nubis.renamed()


def current_names(given: Mapping[str, Value]) -> dict[str, Value]:
    """Values by field name or dotted path, with deprecated names replaced."""
    values: dict[str, Value] = {}
    for path, value in given.items():
        current = ".".join(RENAMED.get(part, part) for part in str(path).split("."))
        if current != path:
            message = f"{path!r} is deprecated: it is {current!r} now"
            warnings.warn(message, DeprecationWarning, stacklevel=3)
            if current in given:
                raise ParameterError(f"{path} and {current} are one field: only one is allowed")
        values[current] = value
    return values


class UnknownKeyError(ParameterError, KeyError):
    """An unknown key of a table of the package."""

    __str__ = Exception.__str__  # KeyError's is a repr


class UnknownArgumentError(ParameterError, TypeError):
    """An unknown keyword of a parameter class."""


def unknown(name: str, given: str, names: Iterable[str], what: str = "one of") -> str:
    """Error message for the argument `name`, whose value `given` is none of `names`."""
    known = list(names)
    near = difflib.get_close_matches(given.lower(), known, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"{name} is not allowed: it must be {what} {', '.join(known)}{hint}"


def unknown_field(name: str, given: str, names: Iterable[str]) -> str:
    """Error message for a field with the unknown path `given`."""
    known = list(names)
    if why := GONE.get(given.rpartition(".")[2]):
        return f"{name} is not allowed: it is gone, as {why}; it must be one of {', '.join(known)}"
    return unknown(name, given, known, "a field that there is, one of")


class Named(Mapping[str, Value]):
    """An immutable mapping; the error for an unknown key lists the keys."""

    def __init__(self, kind: str, values: Mapping[str, Value]) -> None:
        self._kind, self._values = kind, dict(values)

    def __getitem__(self, name: str) -> Value:
        try:
            return self._values[name]
        except (KeyError, TypeError):
            pass
        raise UnknownKeyError(unknown(f"{self._kind} = {name!r}", str(name), self._values))

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._values

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), (self._kind, self._values))

    def __repr__(self) -> str:
        return repr(self._values)


def refuse_arguments(kind: str, given: Iterable[str], names: Iterable[str]) -> None:
    """Raise `UnknownArgumentError` for the first keyword that is none of `names`."""
    known = list(names)
    for name in given:
        if name not in known:
            raise UnknownArgumentError(unknown_field(f"{kind}({name}=...)", name, known))
