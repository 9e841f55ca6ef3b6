"""Numbers that decide what is the same, what is nothing and what is in balance, each of them for all modules.

A number stands here where several modules ask the same question; what sets one algorithm stands beside that.  Modules
read it when they ask, as ``tolerances.RANK``, so that a test can move it.  Each has its meaning, after a semicolon its
unit, and why it is no larger and no smaller.
"""

from __future__ import annotations

import ast
import inspect
import sys
from itertools import pairwise

__all__ = ["table"]

DECIMAL = 1e-12
"""What decimal fractions may be off once numbers were made of them; share of the largest number beside it.

Sums of them miss by 1e-16 to 1e-15; what is meant, as an imperfection out of a plane, is larger by far.
"""

WRITTEN = 1e-9
"""What numbers may be off that a file holds for something else that is told exactly; share of the largest of them.

Programs write ten digits and more.
"""

PARALLEL = 1e-6
"""Angle up to which directions are parallel, and a direction lies in a plane; rad.

Directions are written with seven digits and more; what is meant to be aslant is so by more than a second of arc.
"""

ALIKE = 1e-6
"""What numbers may differ by that a symmetry makes the same; share of the largest of them.

Then the first is taken, so that rounding chooses nothing.  Rounding leaves 1e-13 of the numbers and 1e-10 where they
are differences; what no symmetry makes the same differs by more.
"""

NEGLIGIBLE = 1e-6
"""What is not told, drawn or asked, beside the largest of its kind; share of that.

Differences leave 1e-10 of what does not move, and Newton's method 1e-9 of forces; nobody sees a millionth.
"""

UNIT = 1e-6
"""From where on a number is compared with its unit instead of itself, as it may be zero; share of the unit.

Accuracies are asked for to 1e-14, and what is zero is rounding of its unit: beside itself it would never be accurate.
"""

RANK = 1e-12
"""Singular values and eigenvalues below which directions depend on each other; share of the largest.

Rounding leaves 1e-16 times their number; inertia of wires and beams in one line has 1e-10 in it and less, and counts.
"""

DUAL = 1e-12
"""Softness of rows that may depend on each other, on the diagonal of their multipliers; beside weights of one.

It keeps factors regular and is far above their rounding; Newton's method, and refinement, take back what it changes.
"""

PROXIMAL = 1e-10
"""Weight that keeps neutral directions from being singular, on the diagonal; share of the weight of rotations.

A thousand times less than eigenvalues that count as zero, so that it costs no digit where there is none.
"""

NEUTRAL = 1e-7
"""Eigenvalues that are zero, and stiffness that is none; share of the stiffness of the softest member.

Rounding and Newton's method leave 1e-9 and, of 256 elements that are short, 2e-8; more of rounding comes on top of it.
"""

SOFT = 5e-8
"""Softness of all unknowns in factors that refinement makes good; beside entries of the size of one.

Refinement gains about four digits a round.  Its square stays above rounding: two rows on one soft displacement differ
by that share of their pivots.
"""

CONVERGED = 1e-12
"""What is out of balance, or open, when Newton's method has arrived; share of what is added up there.

Rounding leaves 1e-16 to 1e-14 of it, and Newton's method goes on while it gains.
"""

EXACT = 3e-15
"""What is out of balance when there is nothing left to gain; share of what is added up there.

Ten numbers of the machine: sums of a few terms leave one or two, and a further step would only turn them over.
"""

BALANCED = 1e-9
"""What may be out of balance in an equilibrium where rounding keeps it from less; share of the largest force that acts.

Multipliers that are shared, members of very different stiffness and places of contact leave up to 1e-10.
"""

CLOSED = 1e-9
"""Gaps that count as closed, and how deep what touches may be inside; lengths of the scene, or rad.

Places in a file have ten digits and more, rounding leaves 1e-15; a gap that is meant is one that can be built.
"""

LOST = 1e-5
"""What may be missing in the balance of all that acts on the structure of an answer; share of the largest force.

Rounding leaves 1e-12; places of contact that are conditions of elements leave a thousandth of it.
"""

REACHED = 1e-6
"""Gaps with which a start that was asked for counts as reached, before Newton's method; lengths of the scene, or rad.

The search for a start gains a digit or two a step, and ends at 1e-9 or far away from where members do not reach.
"""

LEVEL = 1e-9
"""What energies of equilibria may differ by that a symmetry makes the same; share of the largest of them.

Rounding leaves 1e-14; loads that choose a side differ by the first power of what they are aside.
"""

REAL = 1e-9
"""Real or imaginary parts that are none; share of the whole number.

Rounding leaves 1e-13 where eigenvalues are apart; damping that is meant is a millionth of the critical one and more.
"""

SAME_STATE = 1e-4
"""How far states of one mesh may be apart that are one equilibrium; rad, at the node where it is most.

Newton's method leaves 1e-10 where an equilibrium is not nearly neutral; two of them nearer than this nearly are.
"""


def table() -> str:
    """All of them in lines: name, value, unit, meaning."""
    body = ast.parse(inspect.getsource(sys.modules[__name__])).body
    lines = []
    for entry, docstring in pairwise(body):
        if (
            isinstance(entry, ast.Assign)
            and isinstance(docstring, ast.Expr)
            and isinstance(docstring.value, ast.Constant)
        ):
            name, value = ast.unparse(entry.targets[0]), ast.literal_eval(entry.value)
            if isinstance(value, float):
                meaning, unit = str(docstring.value.value).split("\n")[0].rstrip(".").split("; ")
                lines.append(f"{name:12}{value:<8g}{unit:52}{meaning}")
    return "\n".join(lines)
