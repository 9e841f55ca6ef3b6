"""What was solved is let go with its answer: long programs and sweeps do not grow."""

import gc
import weakref

import casadi as ca
import numpy as np
import systems
from scenes import cantilever

from sfetcas import Prepared, Scene, solve
from sfetcas.mathematics import kernels
from sfetcas.mathematics.keeping import kept
from sfetcas.solvers.between_states import free_parts


def test_an_answer_ends_with_all_that_was_made_for_it():
    alive = []
    for table in (cantilever(value=[0.1, 0.5]), systems.linked(), systems.linked_space()):
        answer = solve(Scene.from_dict(table))
        last = answer.last
        member = next(name for name, one in last.model.scene.members.items() if one.type == "flexible")
        last.along(member, np.array([0.5]))
        prepared = Prepared(last.model)
        prepared.minimise(last.model.loading(1.0), last.state)
        free_parts(last.model)
        alive += [weakref.ref(part) for part in (answer, last.model, prepared)]
        del answer, last, prepared
    gc.collect()
    assert [one() for one in alive] == [None] * len(alive)


def test_what_is_kept_is_bounded():
    asked = []

    class Owner:
        @kept(2)
        def twice(self, number):
            asked.append(number)
            return 2 * number

    one, other = Owner(), Owner()
    assert [one.twice(n) for n in (1, 2, 1, 3, 1, 2)] == [2, 4, 2, 6, 2, 4]
    # What was asked for last stays.
    assert asked == [1, 2, 3, 2]
    assert other.twice(1) == 2
    assert asked[-1] == 1
    gone = weakref.ref(one)
    del one
    assert gone() is None


def test_functions_that_were_counted_are_let_go():
    x = ca.SX.sym("x")
    for i in range(2 * kernels.COUNTED):
        kernels.chosen(ca.Function(f"f{i}", [x], [x + i]), 1.0)
    assert kernels._instructions.cache_info().currsize <= kernels.COUNTED
