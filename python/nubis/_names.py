"""Names that are not there: what may have been meant, and all that there are."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

from nubis._errors import ParameterError

Value = TypeVar("Value")

# Fields that there are no more, and why.
GONE = {
    "sun_volume": 'nubis.quality("balanced") takes less time and, but for storms, errs less',
    "view_distance": "clouds are drawn to the horizon from any altitude",
}


class UnknownKeyError(ParameterError, KeyError):
    """A name that a table of the package does not have."""

    __str__ = Exception.__str__  # KeyError's is a repr


class UnknownArgumentError(ParameterError, TypeError):
    """A keyword that a class of parameters does not take."""


def unknown(name: str, given: str, names: Iterable[str], what: str = "one of") -> str:
    """The words of an error for the argument `name`, given a name that is none of `names`."""
    known = list(names)
    near = difflib.get_close_matches(given.lower(), known, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"{name} is not allowed: it must be {what} {', '.join(known)}{hint}"


def unknown_field(name: str, given: str, names: Iterable[str]) -> str:
    """The same for a field, whose path is `given`."""
    known = list(names)
    if why := GONE.get(given.rpartition(".")[2]):
        return f"{name} is not allowed: it is gone, as {why}; it must be one of {', '.join(known)}"
    return unknown(name, given, known, "a field that there is, one of")


class Named(Mapping[str, Value]):
    """A table that cannot be changed, and that says what it has where a name is not in it."""

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
    """Raise for the first keyword that is none of `names`."""
    known = list(names)
    for name in given:
        if name not in known:
            raise UnknownArgumentError(unknown_field(f"{kind}({name}=...)", name, known))
