"""Answers that are kept as long as what they are of, and no longer."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, TypeVar

__all__ = ["kept"]

T = TypeVar("T")
P = ParamSpec("P")
R = TypeVar("R")


def kept(most: int) -> Callable[[Callable[Concatenate[T, P], R]], Callable[Concatenate[T, P], R]]:
    """A function whose answers its first argument keeps, of the other ones those that were last asked for.

    A cache of the module, as ``functools.cache`` makes it of a method too, would keep every object that was ever
    asked, with its model and all that was compiled for that.

    Parameters
    ----------
    most : int
        Answers of one object at most.
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
