"""Caches of results: of an object, as long as that lives, and of all that are alike, as long as there is room."""

from __future__ import annotations

import functools
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar

__all__ = ["Recent", "kept"]

T = TypeVar("T")
P = ParamSpec("P")
R = TypeVar("R")


def kept(most: int) -> Callable[[Callable[Concatenate[T, P], R]], Callable[Concatenate[T, P], R]]:
    """Decorator for methods whose results are cached in the object, the least recently used ones being dropped.

    ``functools.cache`` of a method would instead keep every object alive, with its model and its compiled functions.

    Parameters
    ----------
    most : int
        Largest number of results that an object keeps.
    """

    def decorated(function: Callable[Concatenate[T, P], R]) -> Callable[Concatenate[T, P], R]:
        name = f"_kept_{function.__name__}"

        @functools.wraps(function)
        def answer(owner: T, /, *args: P.args, **kwargs: P.kwargs) -> R:
            answers: dict[Any, R] = vars(owner).setdefault(name, {})
            key = (args, *kwargs.items())
            found = answers.pop(key) if key in answers else function(owner, *args, **kwargs)
            answers[key] = found
            while len(answers) > most:
                del answers[next(iter(answers))]
            return found

        return answer

    return decorated


class Recent(Generic[T]):
    """Results by what they are made of; those that were not used for longest make room for others.

    Parameters
    ----------
    room, largest : int
        Sizes of all that are kept together, and of one that is kept.
    """

    def __init__(self, room: int, largest: int) -> None:
        self._left, self._largest = room, largest
        self._known: OrderedDict[Any, tuple[T, int]] = OrderedDict()
        self._lock = threading.Lock()

    def found(self, key: Any, make: Callable[[], T], size: Callable[[T], int]) -> T:
        """The result of a key, known or made now; ``size`` tells that of a result."""
        with self._lock:
            known = self._known.get(key)
            if known is not None:
                self._known.move_to_end(key)
                return known[0]
        made = make()
        own = size(made)
        with self._lock:
            if own <= self._largest and key not in self._known:
                self._known[key] = made, own
                self._left -= own
                while self._left < 0:
                    self._left += self._known.popitem(last=False)[1][1]
        return made
