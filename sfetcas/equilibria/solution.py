"""Answers of static analyses by the names of the scene: positions, reactions, section forces, energies, certificate."""

from __future__ import annotations

import functools
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as File
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from ..contact import closest
from ..description.answers import STATICS, may_lie, outlined
from ..description.obstacles import members_of
from ..description.records import brief, counted, enumerated, nearest, plain
from ..description.scene import Scene, too_sharp
from ..description.showing import (
    error_in_words,
    first_lines,
    notes_in_words,
    number_in_words,
    shown,
    stability_in_words,
)
from ..errors import SceneError, SolveError, Status
from ..mathematics import quaternion
from ..mathematics.arrays import Array
from ..mechanics.balance import SpringState
from ..mechanics.equations import State
from ..mechanics.fields import Fields
from ..mechanics.law_limits import beyond_laws
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from ..solvers.prepared import Solved
from ..solvers.stability import Stability

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..pages.page import View
    from ..pictures.animation import Animation

__all__ = [
    "Certificate",
    "Configuration",
    "Equilibrium",
    "Solution",
    "Viewed",
    "at_factor",
    "equilibrium",
    "heading",
    "heading_in_words",
    "refuse_large",
    "steps_in_words",
    "superelement_notes",
    "touched_notes",
]

MOST_SHOWN = 4
"""Load steps that the text of an answer has."""

MOST_PLACES = 400
"""Largest number of places listed along a member; with more, only ends of elements are listed, evenly thinned out."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """Evidence that a state is an equilibrium, and whether it is stable; all of it is recomputed from the state.

    Attributes
    ----------
    residual : float
        Largest of the ratios of out-of-balance forces and moments to the magnitudes that are summed there, and of the
        gaps of loop closures and joints to the length scale of the model.
    stable : bool, "neutral", or "not defined" for loads without potential
        Whether the second variation of the energy is positive on the tangent space of the constraints.
    negative : int
        Number of negative eigenvalues of the second variation there: independent directions in which energy falls.
    smallest : float
        Its smallest eigenvalue, N: second variation along a field of rotations over the integral of its square. For a
        straight clamped-free column it is the critical load less the load. It goes to zero where stability is lost;
        it is no safety factor, so compare it with its value without load.
    error_estimate : float or None
        Estimated discretisation error of the positions, over the size of the scene.
    halved : float or None
        Difference, in the same measure, from the answer on a mesh with half as many elements.
    error_of : str
        Name of the quantity that ``error_estimate`` and ``halved`` are about; empty for the positions.
    escape : mapping
        Eigenvector of ``smallest`` (the unstable mode, or the softest), for each member: components of rotation about
        the fixed axes, largest 1, at the nodes of its elements.
    """

    residual: float
    stable: bool | str
    negative: int
    smallest: float
    error_estimate: float | None
    halved: float | None = None
    error_of: str = ""
    escape: Mapping[str, Array] = field(repr=False, default_factory=dict)

    def __repr__(self) -> str:
        smallest = f"smallest eigenvalue {self.smallest:.4g} N" if np.isfinite(self.smallest) else ""
        return shown(self, [self.in_words, f"residual {self.residual:.1e}", smallest])

    @property
    def in_words(self) -> str:
        """Stability and estimated error: ``stable, estimated error 1.0e-05 of the size``."""
        stable = stability_in_words(self.stable, self.negative)
        return f"{stable}, {error_in_words(self.error_estimate, self.error_of)}"

    def to_dict(self) -> dict[str, Any]:
        """The certificate as it stands in the JSON answer; undefined values are None."""
        smallest = self.smallest if np.isfinite(self.smallest) else None
        negative = None if self.stable == "not defined" else self.negative
        answer = {"residual": self.residual, "stable": self.stable, "negative": negative, "smallest": smallest}
        answer["error_estimate"] = self.error_estimate
        return {**answer, "error_of": self.error_of} if self.error_of else answer


@dataclass(frozen=True, eq=False)
class Configuration:
    """A state of a model, with its positions, section forces and reactions by the names of the scene.

    All results are in SI units and fixed axes.

    Attributes
    ----------
    factor : float
        Factor that multiplies the loads and prescribed displacements; of a
        :class:`~sfetcas.dynamics.motion.MotionState` the time, s.
    fields : Fields
        Evaluates the state.
    """

    where: ClassVar[str] = STATICS

    factor: float
    fields: Fields = field(repr=False)

    @property
    def model(self) -> Model:
        """The discretised scene."""
        return self.fields.model

    @property
    def state(self) -> State:
        """Unknowns and multipliers, dimensionless."""
        return self.fields.state

    @property
    def loading(self) -> Loading:
        """Loads and prescribed displacements, dimensionless; of a motion with what inertia and dampers do."""
        return self.fields.loading

    def __repr__(self) -> str:
        return shown(self, [f"factor={self.factor:g}"], self._moved())

    def _moved(self) -> list[str]:
        """The first nodes that can move in words, free ends before others."""
        scene = self.model.scene
        free = [name for name in self.model.nodes if scene.nodes[name].support == "free"]
        ends = Counter(name for member in scene.members.values() for name in member.nodes)
        return first_lines(sorted(free, key=ends.__getitem__), self._place, "more nodes")

    def _place(self, name: str) -> str:
        angle = self.angle(name)
        turned = "" if angle is None else f", angle {number_in_words(angle, 'rad')}"
        return f"node {brief(name)}: position {number_in_words(self.position(name), 'm')}{turned}"

    def position(self, node: str) -> Array:
        """Position of a node, (3,) m; SceneError where the scene has no such node."""
        return self.fields.position(self._known(node, self.model.nodes, "node"))

    def quaternion(self, node: str) -> Array | None:
        """Rotation of a node since the undeformed scene as a unit quaternion (4,), scalar first.

        None for a node that is only a point: where all members are hinged to it, it has no rotation of its own.
        """
        rotation = self.fields.rotation(self._known(node, self.model.nodes, "node"))
        return None if rotation is None else self._as_quaternions(rotation[None, :])[0]

    def angle(self, node: str) -> float | None:
        """Rotation of a node about z since the undeformed scene, rad, full turns counted.

        None in space, and for a node without a rotation of its own.
        """
        rotation = self.fields.rotation(self._known(node, self.model.nodes, "node"))
        return None if rotation is None or self.model.space else float(rotation[0])

    def reaction(self, node: str) -> tuple[Array, Array]:
        """Force (3,) N and moment about the node (3,) N m that the ground exerts on the structure at a support.

        Raises
        ------
        SceneError
            There is no such node, or it has no support.
        """
        if self.model.scene.nodes[self._known(node, self.model.nodes, "node")].support == "free":
            raise SceneError(f"node {node!r} is free: no ground acts on it")
        return self.fields.reaction(node)

    def spring(self, name: str) -> SpringState:
        """State of a spring: angle (rad) and moment (N m) on its second party, or travel (m) and force (N)."""
        return self.fields.spring(self._known(name, tuple(self.model.scene.springs), "spring"))

    def tendon(self, name: str) -> dict[str, Any]:
        """State of a tendon: ``tension`` (N), ``length`` (m), and ``slack`` where it may be."""
        return dict(self.fields.tendon(self._known(name, tuple(self.model.scene.tendons), "tendon")))

    def tube(self, name: str) -> dict[str, Any]:
        """State of a tube: ``torque`` (N m) that turns its base, ``angle`` (rad) of its front end against the section
        there, and ``energy`` (J).
        """
        return dict(self.fields.tube(self._known(name, tuple(self.model.scene.tubes), "tube")))

    def ring(self, name: str) -> dict[str, Any]:
        """State of a ring: ``at``, the fraction of the length of its member where it is, its ``force`` (3,) N on the
        member, and of one that is driven ``drive`` (N), the force that moves it towards the second node.
        """
        return dict(self.fields.ring(self._known(name, tuple(self.model.scene.rings), "ring")))

    def along_tube(self, name: str, at: Any) -> dict[str, Array]:
        """Fields of a tube at fractions of its own length, from 0 at its base to 1 at its front end.

        Parameters
        ----------
        name : str
        at : float or (n,)

        Returns
        -------
        dict of ndarray
            ``turn`` (n,) rad, by which it is turned about the tangent against the section there, counting turns;
            ``curvature`` (n, 3) 1/m, its twist and curvatures about its own axes b1, b2, b3, and ``moment`` (n, 3) N m,
            its torque and bending moments about these.  Behind its members the section is their first one.

        Raises
        ------
        SceneError
            There is no such tube, or a fraction is not between 0 and 1.
        """
        known, places = self._known(name, tuple(self.model.scene.tubes), "tube"), np.atleast_1d(at)
        return self.fields.along_tube(known, self._fractions(name, places))

    def told_along(self, kind: str, name: str, at: Any = None) -> dict[str, Array]:
        """:meth:`along` of a member or :meth:`along_tube` of a tube, by the table of the scene.

        At the places that the answer lists where ``at`` is None.
        """
        if kind == "tubes":
            return self.along_tube(name, self.fields.places_of_tube(name) if at is None else at)
        return self.along(name, self.places(name) if at is None else at)

    @staticmethod
    def _fractions(name: str, places: Array) -> Array:
        """Places along a member or a tube, refused where they are none."""
        outside = [place for place in places if not 0.0 <= place <= 1.0]
        if outside or not len(places):
            what = f"{outside[0]:g}" if outside else "none"
            raise SceneError(f"along {name!r}: found {what}, accepted: fractions of the length, from 0 to 1")
        return places

    def motion(self, name: str) -> dict[str, Any]:
        """What enforces a prescribed motion: ``moment`` (N m) or ``force`` (N), see :meth:`.Fields.drive`."""
        return self.fields.drive(self._known(name, tuple(self.model.scene.motions), "motion"))

    def magnet(self, name: str) -> dict[str, Any]:
        """What the fields do to a magnet: ``energy`` (N m), ``torque`` (3,) N m and ``force`` (3,) N, fixed axes."""
        return self.fields.magnet(self._known(name, tuple(self.model.scene.magnets), "magnet"))

    def along(self, member: str, at: Any) -> dict[str, Array]:
        """Fields of a member at fractions of its length, from 0 at its first node to 1.

        Parameters
        ----------
        member : str
        at : float or (n,)

        Returns
        -------
        dict of ndarray
            ``position`` (n, 3) m, ``force`` (n, 3) N, ``moment`` (n, 3) N m, ``curvature`` (n, 3) 1/m as of
            :meth:`.Fields.along`; ``quaternion`` (n, 4) of the rotation since the undeformed scene; in the plane also
            ``angle`` (n,) rad; of a member that stretches or shears the ``strain`` (n, 3) along the section's axes; of
            a flexible member whose section has a shape the largest ``bending_strain`` (n,) and ``bending_stress`` (n,)
            N/m2 of its fibres.

        Raises
        ------
        SceneError
            There is no such member, or a fraction is not between 0 and 1.
        """
        name, places = self._known(member, tuple(self.model.scene.members), "member"), np.atleast_1d(at)
        found = self.fields.along(name, self._fractions(name, places))
        rotation = found.pop("rotation")
        found["quaternion"] = self._as_quaternions(rotation)
        if not self.model.space:
            found["angle"] = rotation[:, 0]
        if outlined(self.model.scene, self.model.scene.members[name]):
            found["bending_strain"], found["bending_stress"] = self.fields.bending(name, places, found["curvature"])
        return found

    def places(self, member: str) -> Array:
        """Fractions of a member's length, rising from 0 to 1, at which the answer lists fields."""
        if self.model.scene.members[member].type != "flexible":
            return np.array([0.0, 1.0])
        places = self.model.along(member)
        if len(places) > MOST_PLACES:
            places = self.model.mesh.cuts[member]
            places = places[np.unique(np.linspace(0, len(places) - 1, MOST_PLACES).round().astype(int))]
        return places

    @property
    def closeness(self) -> float | None:
        """Estimated error of the positions over the size of the scene; None where there is no estimate."""
        return None

    @functools.cached_property
    def contacts(self) -> dict[str, dict[str, Any]]:
        """For each contact of the scene: ``force`` (3,) N on the member, ``at``, ``gap`` in m, ``member``.

        The entries are lists where it touches at several places.  ``at`` is a fraction of the member's length,
        or [from, to] of a stretch, with its resultant force; it is None where nothing touches, with the smallest gap.
        Between members, the force is that on the first one, and ``other`` and ``other_at`` are of the second one.
        """
        scene = self.model.scene
        if not scene.contacts:
            return {}
        return closest.answers(self.fields, self.closeness)

    def pushes(self, contact: str) -> list[tuple[str, float, Array]]:
        """Where an obstacle pushes: member, fraction of its length, of a stretch its middle, and force (3,), N."""
        return [(entry["member"], float(np.mean(entry["at"])), entry["force"]) for entry in self.touched(contact)]

    def touched(self, contact: str) -> list[dict[str, Any]]:
        """What :attr:`contacts` tells of each place or stretch where a state at rest touches."""
        entry = self.contacts[contact]
        if not isinstance(entry["member"], list):
            return [] if entry["at"] is None else [entry]
        return [dict(zip(entry, parts, strict=True)) for parts in zip(*entry.values(), strict=True)]

    @functools.cached_property
    def energy(self) -> dict[str, float]:
        """``elastic`` energy, potential of the ``loads`` since the undeformed scene, and their ``total``, N m.

        Where laws have memory also what they have ``dissipated``, which the total does not have.
        """
        elastic, loads = (part * self.model.scales.moment for part in self._energies)
        lost = {"dissipated": sum(self.fields.dissipated.values())} if self.fields.dissipated else {}
        return {"elastic": elastic, **lost, "loads": loads, "total": elastic + loads}

    @property
    def _energies(self) -> tuple[float, float]:
        """Elastic energy, and potential of the loads, dimensionless."""
        return self.fields.energies

    def table(self, kind: str, name: str = "") -> dict[str, Any]:
        """The quantities of one node, member, spring, ..., under the keys of the JSON answer.

        Parameters
        ----------
        kind : str
            A table of the answer: ``nodes``, ``reactions``, ``members``, ``springs``, ``tendons``, ``tubes``,
            ``rings``, ``motions``, ``magnets``, ``contacts`` or ``energy``; empty for those of the whole state.
        name : str
            Name of the record.  Of a member only integral and largest values; :meth:`along` has its fields.

        Raises
        ------
        SceneError
            The scene has no record of this name.
        """
        tables: dict[str, Callable[[], dict[str, Any]]] = {
            "": lambda: {"factor": self.factor},
            "nodes": lambda: self._node(name),
            "reactions": lambda: dict(zip(("force", "moment"), self.reaction(name), strict=True)),
            "members": lambda: self._member(name),
            "springs": lambda: dict(self.spring(name).to_dict()),
            "tendons": lambda: self.tendon(name),
            "tubes": lambda: self.tube(name),
            "rings": lambda: self.ring(name),
            "motions": lambda: self.motion(name),
            "magnets": lambda: self.magnet(name),
            "contacts": lambda: self.contacts.get(name, {}),
            "energy": lambda: {**self.energy, "potential": self.energy["total"]},
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
        if name in self.fields.dissipated:
            found["dissipated"] = self.fields.dissipated[name]
        if outlined(self.model.scene, self.model.scene.members[name]):
            largest = self.fields.largest_bending(name)
            found |= zip(("largest_bending_strain", "largest_bending_stress"), largest, strict=True)
        return found

    def tables(self, *kinds: str) -> dict[str, dict[str, Any]]:
        """The tables of several kinds, each by the names of its records; empty kinds are left out."""
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
            message = nearest(name, names) if names else f"the scene has no {kind}"
            raise SceneError(f"found {kind} {name!r}; {message}")
        return name


@dataclass(frozen=True, eq=False)
class Equilibrium(Configuration):
    """One equilibrium of a scene, as returned by :func:`sfetcas.solve` and :func:`sfetcas.solve_model`.

    Attributes
    ----------
    certificate : Certificate
    notes : tuple of str
        Remarks for the reader, as: an unstable equilibrium was left, reactions are not unique.
    iterations : int
        Iterations of IPOPT.
    strain, potential : float
        Elastic energy, and its sum with the potential of the loads, dimensionless; :attr:`energy` has them in N m.
    way : tuple of str
        The solution strategies that led to it, in their order, see :data:`~sfetcas.equilibria.ways.WAYS`.
    snaps : tuple of float
        Of a scene with insertions: load factors since the step before at which a state that ceased to be stable was
        left, see :mod:`~sfetcas.equilibria.insertion_steps`.
    """

    certificate: Certificate
    notes: tuple[str, ...]
    iterations: int
    strain: float
    potential: float
    way: tuple[str, ...] = ()
    snaps: tuple[float, ...] = ()

    def __repr__(self) -> str:
        head = [f"factor={self.factor:g}", self.certificate.in_words]
        return shown(self, head, self.lines())

    def lines(self) -> list[str]:
        """The first nodes that can move, and the first note, in words."""
        return [*self._moved(), *notes_in_words(self.notes)]

    def along(self, member: str, at: Any) -> dict[str, Array]:
        """As of :meth:`.Configuration.along`.

        Of a flexible member that obstacles stop also the ``pressure`` (n, 3) N/m of those that it lies along, see
        :meth:`.Fields.pressure`.
        """
        found = super().along(member, at)
        if may_lie(self.model.scene, self.model.scene.members[member]):
            found["pressure"] = self.fields.pressure(member, np.atleast_1d(at))
        return found

    @property
    def _energies(self) -> tuple[float, float]:
        return self.strain, self.potential - self.strain

    @property
    def closeness(self) -> float | None:
        """Estimated error of the positions over the size of the scene; None where there is no such estimate."""
        return None if self.certificate.error_of else self.certificate.error_estimate

    def table(self, kind: str, name: str = "") -> dict[str, Any]:
        """As :meth:`.Configuration.table`; also for the kind ``certificate``."""
        return self.certificate.to_dict() if kind == "certificate" else super().table(kind, name)

    def plot(self, *, colour: str | None = None) -> Figure:
        """The deformed structure over the undeformed one, see :func:`~sfetcas.pictures.plotting.picture`."""
        return Solution(self.model.scene, Status.SOLVED, (self,), {}).plot(colour=colour)

    def to_dict(self) -> dict[str, Any]:
        """The equilibrium as an entry of ``steps`` in the JSON answer."""
        tables = self.tables(
            "nodes", "reactions", "members", "springs", "tendons", "tubes", "rings", "motions", "magnets", "contacts"
        )
        for name, found in tables["members"].items():
            places = self.places(name)
            tables["members"][name] = {"s": places, **self.along(name, places), **found}
        for name, found in tables.get("tubes", {}).items():
            places = self.fields.places_of_tube(name)
            tables["tubes"][name] = {"s": places, **self.along_tube(name, places), **found}
        proof = {"energy": self.energy, "certificate": self.certificate.to_dict()}
        told = {"snaps": list(self.snaps)} if self.snaps else {}
        return {"factor": self.factor, **plain(tables), **proof, **told, "notes": list(self.notes)}


class Viewed:
    """What all answers have: they can be seen in a browser."""

    def page(self, file: str | os.PathLike[str], *, live: bool = False, arguments: Any = None) -> File:
        """Write a page for a browser, ``.html``, that turns, plays and tells its values; its path.

        One file, which asks for nothing else: it can be sent, kept and opened without a network.

        Parameters
        ----------
        file : path
        live : bool
            Whether the page has the solver of the scene, or takes the steps of its motion: arguments change on it.
        arguments : names of numbers of the scene, or a mapping of them to their ranges (low, high)
            Which: by default the factor, all loads and all motions.

        Raises
        ------
        SceneError
            Another ending, a place that cannot be written, or a scene that no live page shows.
        """
        from ..pages.page import save_page

        save_page(cast("Any", self), file, live=live, arguments=arguments)
        return File(file)

    def view(self, *, live: bool = False, arguments: Any = None) -> View:
        """The same page for a notebook: it is shown where this is the last value of a cell.

        Parameters
        ----------
        live, arguments
            As of :meth:`page`.

        Raises
        ------
        SceneError
            As :meth:`page`.
        """
        from ..pages.page import View

        return View(cast("Any", self), live=live, arguments=arguments)


@dataclass(frozen=True, eq=False)
class Solution(Viewed):
    """The answer of a static analysis: an equilibrium for each load factor of ``analysis.steps``.

    Where all equilibria are searched for, ``steps`` has several for a factor, the default one first.

    Attributes
    ----------
    scene : Scene
    status : Status
        SOLVED, or SHORT where a requested accuracy is not reached on a requested mesh.  In the partial solution of a
        :class:`SolveError`: why the next load step failed.
    steps : tuple of Equilibrium
    seconds : mapping
        Wall time of assembling (``model``) and of solving (``solve``), s.
    failure : str
        Where a load step failed: which one, and what was tried.
    """

    scene: Any = field(repr=False)
    status: Status
    steps: tuple[Equilibrium, ...]
    seconds: Mapping[str, float]
    failure: str = ""

    def __repr__(self) -> str:
        return shown(self, heading_in_words(self, self.last.model), [self.failure, *steps_in_words(self.steps)])

    @property
    def last(self) -> Equilibrium:
        """The last of the steps: the equilibrium at the last load factor."""
        return self.steps[-1]

    def plot(
        self,
        quantity: str | None = None,
        *,
        quantities: Sequence[str] | None = None,
        steps: Sequence[int] | None = None,
        colour: str | None = None,
    ) -> Figure:
        """The deformed structure over the undeformed one, or curves of quantities over the load factor.

        Parameters
        ----------
        quantity, quantities : str or sequence of str, optional
            Names as ``nodes.tip.position.y``: curves as of ``curves.curves``.
        steps : sequence of int, optional
        colour : str, optional
            Of the structure, as of :func:`~sfetcas.pictures.plotting.picture`; by default ``moment``.

        Raises
        ------
        SceneError
            There is no such quantity, step or colour, or quantities are given with steps or a colour.
        """
        from ..pictures.curves import curves, one_or_several
        from ..pictures.plotting import picture

        names = one_or_several(quantity, quantities)
        if names is None:
            return picture(self, steps=steps, colour="moment" if colour is None else colour)
        if steps is not None or colour is not None:
            raise SceneError("found quantities with steps or colour, accepted: one of them, as curves show all steps")
        return curves(self, names)

    def animate(self, file: str | os.PathLike[str] | None = None, *, colour: str = "none") -> Animation | File:
        """A moving picture of several steps, see :func:`~sfetcas.pictures.animation.animation`.

        The path of the ``file`` where one is given, ``.gif`` or ``.mp4``; else what notebooks show.
        """
        from ..pictures.animation import animated

        return animated(self, file, colour=colour)

    def to_dict(self) -> dict[str, Any]:
        """The JSON answer as nested dictionaries."""
        return {**heading(self, self.last.model, self.failure), "steps": [step.to_dict() for step in self.steps]}


def heading(answer: Any, model: Model, failure: str = "") -> dict[str, Any]:
    """What each JSON answer begins with: status, title, dimension, number of unknowns and wall time."""
    return {
        "status": answer.status.value,
        **({"failure": failure} if failure else {}),
        "title": answer.scene.title,
        "dimension": model.dimension,
        "unknowns": model.unknowns,
        "seconds": dict(answer.seconds),
    }


def heading_in_words(answer: Any, model: Model) -> list[str]:
    """What the text of each answer begins with: title, status, dimension and elements."""
    title = brief(answer.scene.title) if answer.scene.title else ""
    return [title, answer.status.value, model.dimension, model.elements_in_words]


def steps_in_words(steps: Sequence[Equilibrium]) -> list[str]:
    """A line for each of the last equilibria, and where the nodes of the last one are."""
    lines = [f"factor {step.factor:g}: {step.certificate.in_words}" for step in steps[-MOST_SHOWN:]]
    before = len(steps) - MOST_SHOWN
    return [f"{counted(before, 'step')} before" if before > 0 else "", *lines, *steps[-1].lines()]


def at_factor(
    error: SolveError, scene: Any, factor: float, steps: Sequence[Equilibrium], seconds: Mapping[str, float]
) -> SolveError:
    """The error of one of several load steps, with its factor in the message and ``reached``: the steps before it."""
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
    found: Solved,
    stability: Stability,
    *,
    error_estimate: float | None = None,
    halved: float | None = None,
    error_of: str = "",
    notes: tuple[str, ...] = (),
    iterations: int = 0,
    way: tuple[str, ...] = (),
) -> Equilibrium:
    """What was solved as an :class:`Equilibrium`, with its certificate in SI units.

    Parameters
    ----------
    found : Solved
    stability : Stability
        Result of the stability test, dimensionless.
    error_estimate, halved, error_of
        As in :class:`Certificate`.
    notes, iterations, way
        As in :class:`Equilibrium`.

    Raises
    ------
    SolveError
        The number of turns in the angle of a spring or a driven joint is not determined by the state.
    """
    model, state, notes = found.model, found.state, tuple(dict.fromkeys(notes))
    doubt = model.unwrapping.doubt(state.q, state.unwrapped, found.loading)
    if doubt is not None:
        raise SolveError(Status.FAILED, doubt, state)
    number = found.equations.number
    turn = np.where(number >= 0, stability.shape[number], 0.0) if len(stability.shape) else None
    escape = {} if turn is None else {name: turn[model.chain(name)] for name in model.members}
    certificate = Certificate(
        residual=found.residual,
        stable=stability.stable,
        negative=stability.negative,
        smallest=stability.smallest * model.scales.force,
        error_estimate=error_estimate,
        halved=halved,
        error_of=error_of,
        escape=escape,
    )
    return Equilibrium(
        factor=float(found.factor),
        fields=found.fields,
        certificate=certificate,
        notes=(*notes, *_notes(found.fields)),
        iterations=iterations,
        strain=found.point.strain,
        potential=found.point.potential - found.fields.spent / model.scales.moment,
        way=way,
    )


LARGEST_DEFORMATION = 0.1
"""Displacement over length, or rotation in rad, of a small member beyond which a note is given: errors of some 1 %."""

LARGEST_AXIAL_FORCE = 0.1
"""Axial force of a small member over ``12 EI / L^2`` beyond which a note is given: geometric stiffness left out."""


def refuse_large(fields: Fields) -> None:
    """Refuse a state that is beyond what its scene describes, see :meth:`.Fields.beyond_limits`.

    Raises
    ------
    SolveError
        Names the small member with the largest deformation, the magnet, or the ring.
    """
    error = fields.beyond_limits()
    if error is not None:
        raise error


def _notes(fields: Fields) -> Iterator[str]:
    """Notes on what the model leaves out, or is beyond its validity."""
    yield from touched_notes(fields.model.scene)
    yield from sharp_notes(fields)
    yield from superelement_notes(fields)
    yield from beyond_laws(fields).values()
    yield from strain_notes(fields)
    yield from tendon_notes(fields)


def strain_notes(fields: Fields) -> tuple[str, ...]:
    """A note where stretch and shear of shapes, which are left out, would change positions by more than the accuracy.

    A member of length L that is pulled by N and pushed across by Q changes its ends by about ``N L / EA + Q L / GA``.
    """
    scene, found, kinds = fields.model.scene, dict[str, float](), dict[str, list[str]]()
    for name in fields.model.members:
        record = scene.members[name]
        section = scene.sections[str(record.section)] if record.type == "flexible" else None
        # What has tubes stretches with these, by less, and cannot be asked to.
        if section is None or section.shape is None or section.stretch_law is not None or name in scene.tubed:
            continue
        kinds[name] = ["stretch"] * (not section.stretch) + ["shear"] * (section.sheared and not section.shear)
        x = fields.model.mesh.cuts[name]
        left_out = section.replace(stretch=True, shear=section.sheared).compliance(x) - section.compliance(x)
        strains = fields.section_forces(name, x) * left_out
        found[name] = float(np.abs(strains).max(axis=0).sum()) * scene.center_lines[name].length / scene.size
    accuracy = scene.analysis.accuracy
    worst = max(found, key=lambda name: found[name], default="")
    if not worst or found[worst] <= LEFT_OUT * accuracy:
        return ()
    what, one = " and ".join(kinds[worst]), len(kinds[worst]) == 1
    said = f"{what}, which {'is' if one else 'are'} left out, would move the ends of {worst!r} by about"
    asked = f"{found[worst]:.1g} of the size, and an accuracy of {accuracy:g} is asked for"
    switches = " and ".join(f"{kind} = true" for kind in kinds[worst])
    counted = f"{switches} of the section {str(scene.members[worst].section)!r} {'counts' if one else 'count'}"
    return (f"{said} {asked}: {counted} {'it' if one else 'them'}",)


def tendon_notes(fields: Fields) -> tuple[str, ...]:
    """Notes on tendons whose tension, and chambers whose pressure, a factor makes negative."""
    notes = []
    for name, tendon in fields.model.scene.tendons.items():
        tension = 0.0 if tendon.measured else float(fields.tendon(name)["tension"])
        if tendon.tension is not None and tension < 0.0:
            notes.append(f"the tension of {name!r} is below zero, {tension:.3g} N: it pushes, as no string does")
        elif tendon.pressure is not None and tension > 0.0:
            notes.append(f"the pressure of {name!r} is below zero: it pulls by {tension:.3g} N")
    return tuple(notes)


LEFT_OUT = 3.0
"""Times the accuracy that stretch and shear may move ends of members, by the estimate, before a note tells it."""


def touched_notes(scene: Scene) -> tuple[str, ...]:
    """A note on small members that are flexible ones as they may touch something."""
    names = [name for name, member in scene.members.items() if member.was_small]
    message = "taken for flexible here, as what may touch them bends them between their ends:"
    return (f"{message} {enumerated(names, 'small member')}",) if names else ()


def sharp_notes(fields: Fields) -> Iterator[str]:
    """Notes on members that are bent more sharply than their surfaces allow, which no contact with others sees."""
    scene = fields.model.scene
    for name, contact in scene.contacts.items():
        if not contact.between_members:
            continue
        for member in members_of(contact, scene.members):
            if scene.members[member].type == "flexible":
                found = too_sharp(scene, name, member, functools.partial(_bends, fields, member))
                yield from [f"{found}: its inner side would penetrate itself"] if found else []


def _bends(fields: Fields, member: str, x: Array) -> Array:
    """Curvatures (n, 3), 1/m, at fractions of the length of a member."""
    return fields.along(member, x)["curvature"]


def superelement_notes(fields: Fields) -> tuple[str, ...]:
    """Notes on small members beyond linear elasticity by deformation or axial force; error estimates do not see it."""
    superelements = [name for name, member in fields.model.scene.members.items() if member.type == "small"]
    message = "the error estimate does not tell"
    notes = []
    for measure, limit, words in (
        (
            lambda name: fields.bent[name],
            LARGEST_DEFORMATION,
            f"bends by {{:.2g}} of its length or rad{{}}: its linear elasticity is for a few percent, and {message}",
        ),
        (
            fields.pulled,
            LARGEST_AXIAL_FORCE,
            f"carries {{:.2g}} of 12 EI / L^2 along it{{}}: what that does across it is left out, and {message}",
        ),
    ):
        found = {name: measure(name) for name in superelements}
        far = sorted((name for name in superelements if found[name] > limit), key=lambda name: -found[name])
        if far:
            others = f", as {counted(len(far) - 1, 'other', 'others')} do" if far[1:] else ""
            notes.append(f"the small member {far[0]!r} {words.format(found[far[0]], others)}")
            # Each is told once.
            superelements = [name for name in superelements if name not in far]
    return tuple(notes)
