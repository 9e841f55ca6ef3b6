"""A cache of results that lives as long as the object that they belong to."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, TypeVar

__all__ = ["kept"]

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
