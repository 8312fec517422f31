"""What a function reads of the parameters that it is given, so that it need not be asked twice for the same.

A simulation has dozens of parameters of its own, most of them of the airframe. Its actuators read a few. A
function that has the same values of all that it read before reads the same again, and answers the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Generic, TypeVar
from weakref import ref

Result = TypeVar("Result")

_ABSENT = object()
_MOST = 4  # answers that are kept: about nominal and likeliest parameters, and the last two


class Noted(dict[str, Any]):
    """Parameters that note which of them are read.

    Attributes
    ----------
    read : dict
        Values by name; a name that was looked for and is not there has a value of its own.
    whole : bool
        Whether all were read at once, as a loop over them does.
    """

    def __init__(self, values: Mapping[str, Any]):
        super().__init__(values)
        self.read: dict[str, Any] = {}
        self.whole = False

    def __getitem__(self, name: str) -> Any:
        self.read[name] = super().get(name, _ABSENT)
        return super().__getitem__(name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return a value, noted."""
        self.read[name] = super().get(name, _ABSENT)
        return super().get(name, default)

    def __contains__(self, name: object) -> bool:
        self.read[str(name)] = super().get(name, _ABSENT)  # type: ignore[arg-type]
        return super().__contains__(name)

    def __iter__(self) -> Iterator[str]:
        self.whole = True
        return super().__iter__()

    def __len__(self) -> int:
        self.whole = True
        return super().__len__()


def _all_at_once(name: str) -> Callable[..., Any]:
    def method(self: Noted, *given: Any, **named: Any) -> Any:
        self.whole = True
        return getattr(dict, name)(self, *given, **named)

    return method


_WHOLE = "keys values items copy pop popitem setdefault update clear __eq__ __ne__ __or__ __ror__ __ior__"
for _name in f"{_WHOLE} __reversed__ __setitem__ __delitem__".split():
    setattr(Noted, _name, _all_at_once(_name))


class Answers(Generic[Result]):
    """A function's last answers about each thing, by what it read of its parameters."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[ref[Any], list[tuple[dict[str, Any], Result]]]] = {}

    def of(self, what: Any, parameters: Mapping[str, Any], ask: Callable[[Noted], Result]) -> Result:
        """Return the answer to parameters, asked for where it is not known.

        Parameters
        ----------
        what : object
            What is asked about besides, as a record; answers are kept as long as it is.
        parameters : mapping
        ask : callable
            Asks the function, with parameters that note what is read.
        """
        key = id(what)
        if key not in self._known:
            self._known[key] = ref(what, lambda _: self._known.pop(key, None)), []
        known = self._known[key][1]
        for k, (read, answer) in enumerate(known):
            if all(parameters.get(n, _ABSENT) == value for n, value in read.items()):
                known.insert(0, known.pop(k))
                return answer
        noted = Noted(parameters)
        answer = ask(noted)
        if not noted.whole:
            known[:] = [(noted.read, answer), *known[: _MOST - 1]]
        return answer
