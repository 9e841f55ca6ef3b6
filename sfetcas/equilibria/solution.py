"""Equilibria by name: positions, reactions, section forces, energies and the certificate."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ..contact.touches import answers
from ..description.answers import STATICS, outlined
from ..description.records import counted, nearest, plain
from ..errors import SceneError, SolveError, Status
from ..mathematics import quaternion
from ..mathematics.arrays import Array
from ..mechanics.balance import SpringState
from ..mechanics.equations import Equations, Point, State
from ..mechanics.fields import Fields
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from ..solvers.stability import Stability

__all__ = [
    "Certificate",
    "Configuration",
    "Equilibrium",
    "Solution",
    "at_factor",
    "equilibrium",
    "heading",
    "not_small",
    "refuse_large",
]

MOST_PLACES = 400
"""Places listed along a member at most; with more elements only their ends, thinned out."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """What proves an answer, all recomputed from the state and not taken from a solver.

    Attributes
    ----------
    residual : float
        Largest out-of-balance force or moment over the largest that was added up, or gap over the length scale.
    stable : bool, "neutral", or "not defined" for loads without potential
        Inertia of the energy on the closings.
    negative : int
        Its negative eigenvalues.
    smallest : float
        Its smallest eigenvalue, N: second variation by a rotation field over the integral of its square.
    error_estimate : float or None
        Estimated discretisation error of the positions over the size of the scene.
    halved : float or None
        How far, in the same measure, the answer on half the elements was from this.
    error_of : str
        The quantity that these two are of; empty: the positions.
    escape : mapping
        Escape shape by member: rotations about the fixed axes, largest 1, at the places of ``Equilibrium.places``.
    """

    residual: float
    stable: bool | str
    negative: int
    smallest: float
    error_estimate: float | None
    halved: float | None = None
    error_of: str = ""
    escape: Mapping[str, Array] = field(repr=False, default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """As in the JSON answer."""
        smallest = self.smallest if np.isfinite(self.smallest) else None
        negative = None if self.stable == "not defined" else self.negative
        answer = {"residual": self.residual, "stable": self.stable, "negative": negative, "smallest": smallest}
        answer["error_estimate"] = self.error_estimate
        return {**answer, "error_of": self.error_of} if self.error_of else answer


@dataclass(frozen=True, eq=False)
class Configuration:
    """A state of a model by name: positions, section forces, reactions.

    Attributes
    ----------
    factor : float
        Factor of the loads and motions.
    model : Model
        Discretisation that the state is on.
    state, loading
        Unknowns and loads, dimensionless.
    """

    where: ClassVar[str] = STATICS

    factor: float
    model: Model = field(repr=False)
    state: State = field(repr=False)
    loading: Loading = field(repr=False)
    fields: Fields = field(repr=False)

    def position(self, node: str) -> Array:
        """Position of a node, (3,) m."""
        return self.fields.position(self._known(node, self.model.nodes, "node"))

    def quaternion(self, node: str) -> Array | None:
        """Rotation of a node since the undeformed scene, (4,); None where it has no rotation of its own."""
        rotation = self.fields.rotation(self._known(node, self.model.nodes, "node"))
        return None if rotation is None else self._as_quaternions(rotation[None, :])[0]

    def angle(self, node: str) -> float | None:
        """Rotation about z since the undeformed scene, rad, counting turns; in the plane only."""
        rotation = self.fields.rotation(self._known(node, self.model.nodes, "node"))
        return None if rotation is None or self.model.space else float(rotation[0])

    def reaction(self, node: str) -> tuple[Array, Array]:
        """Force (3,) N and moment about the node (3,) N m that the ground exerts on the structure."""
        if self.model.scene.nodes[self._known(node, self.model.nodes, "node")].support == "free":
            raise SceneError(f"node {node!r} is free: no ground acts on it")
        return self.fields.reaction(node)

    def spring(self, name: str) -> SpringState:
        """A spring: angle (rad) and moment (N m) on its second party, or travel (m) and force (N)."""
        return self.fields.spring(self._known(name, tuple(self.model.scene.springs), "spring"))

    def motion(self, name: str) -> dict[str, Any]:
        """What makes a motion: ``moment`` with a rotation, ``force`` with a displacement, see :meth:`Fields.drive`."""
        return self.fields.drive(self._known(name, tuple(self.model.scene.motions), "motion"))

    def along(self, member: str, at: Any) -> dict[str, Array]:
        """Fields of a member at fractions of its length, see :meth:`Fields.along`; quaternions added."""
        name, places = self._known(member, tuple(self.model.scene.members), "member"), np.atleast_1d(at)
        outside = [place for place in places if not 0.0 <= place <= 1.0]
        if outside or not len(places):
            what = f"{outside[0]:g}" if outside else "none"
            raise SceneError(f"along {name!r}: found {what}, accepted: fractions of the length, from 0 to 1")
        found = self.fields.along(name, places)
        rotation = found.pop("rotation")
        found["quaternion"] = self._as_quaternions(rotation)
        if not self.model.space:
            found["angle"] = rotation[:, 0]
        if outlined(self.model.scene, self.model.scene.members[name]):
            found["bending_strain"], found["bending_stress"] = self.fields.bending(name, places, found["curvature"])
        return found

    def places(self, member: str) -> Array:
        """Fractions of the length that the answer lists: nodes of the elements, or fewer."""
        if self.model.scene.members[member].type != "flexible":
            return np.array([0.0, 1.0])
        places = self.model.along(member)
        if len(places) > MOST_PLACES:
            places = self.model.mesh.cuts[member]
            places = places[np.unique(np.linspace(0, len(places) - 1, MOST_PLACES).round().astype(int))]
        return places

    @functools.cached_property
    def contacts(self) -> dict[str, dict[str, Any]]:
        """Of each obstacle ``force`` (3,) N on the member, ``at``, ``gap`` m, ``member``; lists where several touch.

        ``at`` is a fraction of the length, or [from, to] of a stretch whose whole force is given; None, with the
        smallest gap, where nothing touches.
        """
        return answers(self.fields) if self.model.scene.contacts else {}

    def table(self, kind: str, name: str = "") -> dict[str, Any]:
        """What is told of one thing, under the keys of the JSON answer.

        Parameters
        ----------
        kind : str
            A table of the answer, as ``nodes``; empty for what stands in none.
        name : str
            Of the node, member, ...; of a member what it has once, not that of its places, see :meth:`along`.

        Raises
        ------
        SceneError
            There is no such thing.
        """
        tables: dict[str, Callable[[], dict[str, Any]]] = {
            "": lambda: {"factor": self.factor},
            "nodes": lambda: self._node(name),
            "reactions": lambda: dict(zip(("force", "moment"), self.reaction(name), strict=True)),
            "members": lambda: self._member(name),
            "springs": lambda: dict(self.spring(name).to_dict()),
            "motions": lambda: self.motion(name),
            "contacts": lambda: self.contacts.get(name, {}),
        }
        return tables[kind]() if kind in tables else {}

    def _node(self, name: str) -> dict[str, Any]:
        found: dict[str, Any] = {"position": self.position(name)}
        turned = self.quaternion(name)
        if turned is not None:
            found["quaternion"] = turned
            if not self.model.space:
                found["angle"] = self.angle(name)
        return found

    def _member(self, name: str) -> dict[str, Any]:
        """What a member has once: its strain energy and the most that bends its fibres."""
        self._known(name, tuple(self.model.scene.members), "member")
        found: dict[str, Any] = {}
        if self.model.scene.members[name].type != "rigid":
            found["energy"] = self.fields.strain_energy(name)
        if outlined(self.model.scene, self.model.scene.members[name]):
            largest = self.fields.largest_bending(name)
            found |= zip(("largest_bending_strain", "largest_bending_stress"), largest, strict=True)
        return found

    def tables(self, *kinds: str) -> dict[str, dict[str, Any]]:
        """For each kind the tables of all of it that there are; kinds of which there is nothing are left out."""
        scene = self.model.scene
        names = {"nodes": self.model.nodes, "reactions": [n for n, r in scene.nodes.items() if r.support != "free"]}
        names |= {kind: list(getattr(scene, kind)) for kind in kinds if kind not in names}
        always = ("nodes", "reactions", "members")
        return {k: {n: self.table(k, n) for n in names[k]} for k in kinds if names[k] or k in always}

    def _as_quaternions(self, rotation: Array) -> Array:
        if self.model.space:
            return rotation
        zero = np.zeros(len(rotation))
        return quaternion.from_rotation_vector(np.stack([zero, zero, rotation[:, 0]], axis=-1))

    @staticmethod
    def _known(name: str, names: tuple[str, ...], kind: str) -> str:
        if name not in names:
            told = nearest(name, names) if names else f"the scene has no {kind}"
            raise SceneError(f"found {kind} {name!r}; {told}")
        return name


@dataclass(frozen=True, eq=False)
class Equilibrium(Configuration):
    """One equilibrium, made by :func:`sfetcas.solve` and :func:`sfetcas.solve_model`.

    Attributes
    ----------
    certificate : Certificate
    notes : tuple of str
        What a reader should know: an unstable state that was left, reactions that are not unique.
    iterations : int
        Iterations of IPOPT.
    way : tuple of str
        How it was found, one way after the other, see :data:`~sfetcas.equilibria.ways.WAYS`.
    """

    certificate: Certificate
    notes: tuple[str, ...]
    iterations: int
    strain: float
    potential: float
    way: tuple[str, ...] = ()

    @functools.cached_property
    def energy(self) -> dict[str, float]:
        """Elastic energy, potential of the loads, and their sum, N m; zero for the undeformed scene."""
        unit = self.model.scales.moment
        elastic, total = self.strain * unit, self.potential * unit
        return {"elastic": elastic, "loads": total - elastic, "total": total}

    def table(self, kind: str, name: str = "") -> dict[str, Any]:
        """As of :meth:`Configuration.table`; also energies and the certificate."""
        if kind == "certificate":
            return self.certificate.to_dict()
        if kind == "energy":
            return {**self.energy, "potential": self.energy["total"]}
        return super().table(kind, name)

    def to_dict(self) -> dict[str, Any]:
        """As an entry of ``steps`` in the JSON answer."""
        tables = self.tables("nodes", "reactions", "members", "springs", "motions", "contacts")
        for name, found in tables["members"].items():
            places = self.places(name)
            tables["members"][name] = {"s": places, **self.along(name, places), **found}
        proof = {"energy": self.energy, "certificate": self.certificate.to_dict()}
        return {"factor": self.factor, **plain(tables), **proof, "notes": list(self.notes)}


@dataclass(frozen=True, eq=False)
class Solution:
    """The answer of a scene: one equilibrium a load factor.

    Attributes
    ----------
    status : Status
        SOLVED, or SHORT where an accuracy that was asked for is not reached on the mesh that was asked for; of the
        steps that a :class:`SolveError` reached, why the next one failed.
    steps : tuple of Equilibrium
    seconds : dict
        Time spent on models and on solving.
    failure : str
        Where a step failed: which, and what was tried.
    """

    scene: Any = field(repr=False)
    status: Status
    steps: tuple[Equilibrium, ...]
    seconds: Mapping[str, float]
    failure: str = ""

    @property
    def last(self) -> Equilibrium:
        """The equilibrium of the last factor."""
        return self.steps[-1]

    def to_dict(self) -> dict[str, Any]:
        """The JSON answer."""
        return {**heading(self, self.last.model, self.failure), "steps": [step.to_dict() for step in self.steps]}


def heading(answer: Any, model: Model, failure: str = "") -> dict[str, Any]:
    """What every JSON answer begins with: how it ended, of which scene it is, its size and what it cost."""
    return {
        "status": answer.status.value,
        **({"failure": failure} if failure else {}),
        "title": answer.scene.title,
        "dimension": model.dimension,
        "unknowns": model.unknowns,
        "seconds": dict(answer.seconds),
    }


def at_factor(
    error: SolveError, scene: Any, factor: float, steps: Sequence[Equilibrium], seconds: Mapping[str, float]
) -> SolveError:
    """The error of one of several steps: with its factor, and with the steps before it."""
    if len(scene.analysis.steps) == 1:
        return error
    detail = f"at factor {factor:.10g}" + (f": {error.detail}" if error.detail else "")
    if steps:
        detail += f"; {counted(len(steps), 'step', 'steps')} before it solved"
    named = SolveError(error.status, detail, error.last)
    if steps:
        named.reached = Solution(scene, error.status, tuple(steps), seconds, detail)
    return named


def equilibrium(
    equations: Equations,
    state: State,
    loading: Loading,
    factor: float,
    point: Point,
    residual: float,
    stability: Stability,
    *,
    error_estimate: float | None = None,
    halved: float | None = None,
    error_of: str = "",
    notes: tuple[str, ...] = (),
    iterations: int = 0,
    way: tuple[str, ...] = (),
) -> Equilibrium:
    """Put an equilibrium together; dimensionless in, by name and in SI out.

    Raises
    ------
    SolveError
        The angle of a spring cannot be told.
    """
    model, notes = equations.model, tuple(dict.fromkeys(notes))
    doubt = model.winding.doubt(state.q, state.wound, loading)
    if doubt is not None:
        raise SolveError(Status.FAILED, doubt, state)
    turn = np.where(equations.number >= 0, stability.shape[equations.number], 0.0) if len(stability.shape) else None
    escape = {} if turn is None else {name: turn[model.chain(name)] for name in model.members}
    certificate = Certificate(
        residual=residual,
        stable=stability.stable,
        negative=stability.negative,
        smallest=stability.smallest * model.scales.force,
        error_estimate=error_estimate,
        halved=halved,
        error_of=error_of,
        escape=escape,
    )
    fields = Fields(equations, state, loading)
    return Equilibrium(
        factor=factor,
        model=model,
        state=state,
        loading=loading,
        certificate=certificate,
        notes=(*notes, *not_small(fields)),
        iterations=iterations,
        strain=point.strain,
        potential=point.potential,
        way=way,
        fields=fields,
    )


SMALL = 0.1
"""Displacement over size, and rotation in rad, up to which a small member is one: what is left out is of order 1 %."""

SMALL_PULL = 0.1
"""Axial force over ``12 EI / L^2`` up to which a small member is one: by as much it is too soft or too stiff across."""


def refuse_large(fields: Fields) -> None:
    """Refuse a small member that bends so far that its linear elasticity tells nothing.

    Raises
    ------
    SolveError
        Naming the one that bends most.
    """
    told = fields.too_large()
    if told:
        raise SolveError(Status.BENT, told)


def not_small(fields: Fields) -> tuple[str, ...]:
    """Notes where small members bend or are pulled beyond linear elasticity, which no error estimate sees."""
    small = [name for name, member in fields.model.scene.members.items() if member.type == "small"]
    told = "the error estimate does not tell"
    notes = []
    for measure, limit, words in (
        (
            fields.bent,
            SMALL,
            f"bends by {{:.2g}} of its length or rad{{}}: its linear elasticity is for a few percent, and {told}",
        ),
        (
            fields.pulled,
            SMALL_PULL,
            f"carries {{:.2g}} of 12 EI / L^2 along it{{}}: what that does across it is left out, and {told}",
        ),
    ):
        found = {name: measure(name) for name in small}
        far = sorted((name for name in small if found[name] > limit), key=lambda name: -found[name])
        if far:
            others = f", as {counted(len(far) - 1, 'other', 'others')} do" if far[1:] else ""
            notes.append(f"the small member {far[0]!r} {words.format(found[far[0]], others)}")
            # Each is told once.
            small = [name for name in small if name not in far]
    return tuple(notes)
