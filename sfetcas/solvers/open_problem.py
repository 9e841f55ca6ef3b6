"""The equilibrium problem, open to a user's own terms, rows and bounds in CasADi.

:func:`.equilibrium_nlp` gives the potential energy of a model with its constraints as a plain
:class:`~sfetcas.mathematics.nlp.NLP`, and expressions for what the scene names: positions, angles, curvatures.  Add to
it, solve it with any nlpsol plugin, read the answer by name.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..description.answers import answer_name
from ..description.records import brief, counted, nearest
from ..description.showing import named, shown, values_in_words
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.nlp import NLP, Ipopt, NLPResult, Solver
from ..mathematics.statements import Statement
from ..mechanics.equations import State
from ..mechanics.model import Model
from .prepared import Prepared
from .problem import EquilibriumProblem

__all__ = ["OpenAnswer", "OpenProblem", "equilibrium_nlp"]


def equilibrium_nlp(model: Model | Prepared, factor: float = 1.0) -> OpenProblem:
    """The equilibrium of a model at a load factor as a nonlinear program that can be extended.

    Raises
    ------
    SceneError
        The scene has loads without potential, contacts, or stops of springs.

    Examples
    --------
    >>> problem = equilibrium_nlp(assemble(scene, uniform_mesh(scene, 4, 8)))      # doctest: +SKIP
    >>> tip = problem.answer("nodes.tip.position")                                # doctest: +SKIP
    >>> answer = problem.subject_to(tip[1] == 0.2, name="tip on the line").solve()  # doctest: +SKIP
    """
    prepared = model if isinstance(model, Prepared) else Prepared(model)
    prepared.model.check_complete()
    if not prepared.model.minimisable:
        raise SceneError("loads that follow and moments in space have no energy, which a program to be extended needs")
    loading = prepared.model.loading(factor)
    guess, _ = prepared.guess(loading)
    return OpenProblem(prepared, factor, EquilibriumProblem(prepared.model, loading, guess, kernels="interpreted"))


@dataclass(frozen=True, eq=False)
class OpenProblem:
    """The program of an equilibrium with expressions in SI units by the names of the scene.

    Attributes
    ----------
    prepared : Prepared
    factor : float
        Load factor.
    parts : EquilibriumProblem
        The program of the model alone, with its unknowns and parameters.
    extended : NLP, optional
        The program with what was added; None before that.
    added : tuple of (str, float, int)
        Name, unit and number of rows of each constraint that was added.
    """

    prepared: Prepared
    factor: float
    parts: EquilibriumProblem
    extended: NLP | None = None
    added: tuple[tuple[str, float, int], ...] = field(default=())

    def __repr__(self) -> str:
        added = named((name for name, _, _ in self.added), "constraint")
        return shown(self, [f"factor={self.factor:g}"], [repr(self.nlp), f"added {added}" if added else ""])

    @property
    def nlp(self) -> NLP:
        """The program as it stands; its objective is the potential energy over ``model.scales.moment``."""
        return self.extended or self.parts.nlp

    @property
    def model(self) -> Model:
        """The model behind the program."""
        return self.prepared.model

    # -- expressions ----------------------------------------------------------------------------

    def position(self, node: str) -> ca.MX:
        """Position of a node, (2,) or (3,) m; SceneError for an unknown name."""
        _known(node, self.model.nodes, "node")
        start = np.asarray(self.model.scene.nodes[node].position)[: self.model.element.axes]
        return ca.DM(start) + self.model.scales.length * self.parts.displacement(self.model.nodes.index(node))

    def rotation(self, node: str) -> ca.MX:
        """Rotation of a node since the undeformed scene: an angle in the plane, rad, a unit quaternion (4,) in space.

        Raises
        ------
        SceneError
            There is no such node, or it has no rotation of its own.
        """
        number = self.model.rotations.node_turn[_known(node, self.model.nodes, "node")]
        if number is None:
            raise SceneError(f"node {node!r} has no rotation of its own")
        return self.parts.rotation(number)

    def curvature(self, member: str, at: float) -> ca.MX:
        """Curvature minus that of the unloaded member at a fraction of its length, 1/m.

        A number in the plane, (3,) about the section's axes b1, b2, b3 in space.
        """
        _known(member, self.model.members, "member")
        return self.parts.strain(member, at) / self.model.scales.length

    def answer(self, name: str) -> ca.MX:
        """An answer by its name, SI.

        ``nodes.tip.position``, m; ``nodes.tip.angle``, rad, in space ``nodes.tip.quaternion``; and
        ``members.beam.curvature at 0.5``, 1/m, minus that of the unloaded member.

        Raises
        ------
        SceneError
            Any other name.
        """
        asked = answer_name(name, "answer")
        kind, turned = (asked.kind.table, asked.kind.key), "quaternion" if self.model.space else "angle"
        if kind == ("nodes", "position"):
            found = self.position(asked.record)
        elif kind == ("nodes", turned):
            found = self.rotation(asked.record)
        elif kind == ("members", "curvature") and asked.at is not None:
            found = self.curvature(asked.record, asked.at)
        else:
            accepted = f"nodes.NAME.position, nodes.NAME.{turned}, members.NAME.curvature at PLACE"
            raise SceneError(f"found {name!r}, accepted: {accepted}", ("answer",))
        # In the plane there is one curvature, about b3, and no z.
        number = asked.component if found.numel() > 1 else None
        return found if number is None else found[number]

    # -- extensions -----------------------------------------------------------------------------

    def subject_to(self, *relations: ca.MX, name: str = "", unit: float = 1.0) -> OpenProblem:
        """The problem with further constraints: ``x == 2``, ``x <= 3``, ``-1 <= (x <= 1)``, element by element.

        Parameters
        ----------
        relations : MX
            In expressions of this problem, SI.
        name : str
            Name of their multipliers; by default the text of the relation.
        unit : float
            Magnitude by which they are divided, in their own unit.

        Raises
        ------
        SceneError
            An argument is no relation, its bounds contradict each other, or it has a symbol of another problem.
        """
        statement, found = Statement(), self
        for symbol in (self.nlp.x, self.nlp.p):
            statement.known(symbol)
        statement.subject_to(*relations, name=name)
        for one in statement.required:
            found = found.with_row(one.name, one.relation.expression, one.relation.low, one.relation.high, unit=unit)
        return found

    def minimise(self, energy: ca.MX) -> OpenProblem:
        """The problem with a term (N m) added to the objective, as :meth:`with_energy`."""
        return self.with_energy(energy)

    def with_row(
        self, name: str, row: ca.MX, lower: ArrayLike = 0.0, upper: ArrayLike | None = None, *, unit: float = 1.0
    ) -> OpenProblem:
        """The problem with constraints ``lower <= row <= upper``; equal to ``lower`` without ``upper``.

        ``unit`` is the magnitude of the row in its own unit, by which the constraint is divided.
        """
        scaled = None if upper is None else np.asarray(upper, dtype=float) / unit
        nlp = self.nlp.with_row(name, row / unit, np.asarray(lower, dtype=float) / unit, scaled)
        return replace(self, extended=nlp, added=(*self.added, (name, unit, ca.vec(row).numel())))

    def with_energy(self, energy: ca.MX) -> OpenProblem:
        """The problem with a term (N m) added to the potential energy."""
        return replace(self, extended=self.nlp.with_term(energy / self.model.scales.moment))

    # -- solution -------------------------------------------------------------------------------

    def solve(self, solver: Ipopt | Solver | None = None) -> OpenAnswer:
        """Solve with IPOPT, or any nlpsol plugin: ``problem.solve(Solver("sqpmethod"))``.

        Raises
        ------
        SolveError
            The solver did not succeed; the sentence says what it reported.
        """
        result = (solver or Ipopt()).solve(self.nlp)
        if result.status is not Status.SOLVED:
            raise SolveError(result.status, result.message, result)
        return OpenAnswer(self, result)


@dataclass(frozen=True, eq=False)
class OpenAnswer:
    """The solution of an extended program, read by name in SI units."""

    problem: OpenProblem
    result: NLPResult

    def __repr__(self) -> str:
        values = {f"multiplier of {brief(name)}": self.multiplier(name) for name, _, _ in self.problem.added}
        head = [self.result.status.value, counted(self.result.iterations, "iteration")]
        return shown(self, head, values_in_words(values))

    def value(self, expression: ca.MX) -> Array:
        """Value of an expression of the problem, in the unit and (squeezed) shape of the expression."""
        nlp = self.problem.nlp
        return np.asarray(
            ca.Function("value", [nlp.x, nlp.p], [expression])(self.result.x, nlp.p_value).full()
        ).squeeze()

    def position(self, node: str) -> Array:
        """Position of a node, (3,) m."""
        position = np.zeros(3)
        found = self.value(self.problem.position(node))
        position[: len(found)] = found
        return position

    def multiplier(self, name: str) -> Array:
        """Multiplier (rows,) of an added constraint: the generalised force that keeps it, N m over the row's unit.

        Raises
        ------
        SceneError
            No constraint of this name was added.
        """
        position = len(self.problem.parts.nlp.rows)
        for row, unit, size in self.problem.added:
            if row == name:
                return self.result.lam[position : position + size] * self.problem.model.scales.moment / unit
            position += size
        raise SceneError(f"found row {name!r}; {nearest(name, [row for row, _, _ in self.problem.added])}")

    @property
    def state(self) -> State:
        """The state with the multipliers of the model's own rows, dimensionless."""
        loading = self.problem.model.loading(self.problem.factor)
        return self.problem.parts.state(self.result.x, self.result.lam, loading)


def _known(name: str, names: tuple[str, ...], kind: str) -> str:
    if name not in names:
        raise SceneError(f"found {kind} {name!r}; {nearest(name, names)}")
    return name
