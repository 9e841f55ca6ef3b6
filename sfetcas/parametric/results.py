"""Results of parametric solvers and generated code: positions, rotations, reactions, section forces, stiffness.

Reactions are derivatives of the Lagrangian by restrained coordinates, section forces follow from the internal force at
the integration points: both are as accurate as the positions.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from .. import tolerances
from ..description.answers import PARAMETERS, STEPS, AnswerName, answer_name, check_answer, single_number
from ..description.records import counted, unknown
from ..description.tendons import Stretch
from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import Array, numbers, values_of
from ..mathematics.constants import sparse, times
from ..mechanics.connections import connections_of, row_of
from ..mechanics.laws import bent_by, law_data, law_of
from ..mechanics.load_terms import spread_of
from ..mechanics.magnetism import magnet_terms
from ..mechanics.mesh import ContactPoint
from ..mechanics.model import Model
from ..mechanics.reactions import Reactions, shares_rotation
from ..mechanics.rings import up_to
from ..mechanics.segments import SIDES, standing
from ..mechanics.singles import fibre_strain, spin_of, turned_vector
from ..mechanics.stationarity import Stationarity
from ..mechanics.stations import Stations
from ..mechanics.tendon_chains import part_of
from ..mechanics.tendon_shares import NEWTON_STEPS, section_data, share_of, stretches_of
from ..mechanics.terms import Group, answers_of
from ..solvers.program import Program

__all__ = ["Moving", "Outputs", "Result", "Results", "default_motion_results", "default_results"]


@dataclass(frozen=True)
class Result:
    """One result: a number, a vector, or along a member a row for each place.

    Attributes
    ----------
    name : str
        As it was asked for: ``nodes.tip.position``.
    asked : AnswerName
        Its parsed name.
    shape : tuple of int
        ``(places, ...)`` along a member, unless the name has one place.
    unit, meaning : str
    """

    name: str
    asked: AnswerName
    shape: tuple[int, ...]
    unit: str
    meaning: str

    @property
    def size(self) -> int:
        """Number of its numbers."""
        return int(np.prod(self.shape, dtype=int))

    @property
    def member(self) -> str:
        """The member along which it has a row for each place; empty for all others."""
        return self.asked.record if self.asked.kind.along and self.asked.at is None else ""


def default_results(model: Model, *, unique: bool = True) -> list[str]:
    """Names of the default results: positions and rotations of nodes, positions of members, springs.

    With ``unique``, reactions and section forces as well.
    """
    names = []
    rotation = "quaternion" if model.space else "angle"
    for name in model.nodes:
        names.append(f"nodes.{name}.position")
        if model.rotations.node_turn[name] is not None:
            names.append(f"nodes.{name}.{rotation}")
    for name, node in model.scene.nodes.items():
        if node.support != "free" and unique:
            names += [f"reactions.{name}.force", f"reactions.{name}.moment"]
    for name, member in model.scene.members.items():
        if member.type == "flexible":
            fields = ("position", rotation, "force", "moment") if unique else ("position", rotation)
            names += [f"members.{name}.{field}" for field in fields]
    for name, spring in model.scene.springs.items():
        pair = ("angle", "moment") if spring.type == "rotational" else ("travel", "force")
        names += [f"springs.{name}.{field}" for field in pair]
    for name, tendon in model.scene.tendons.items():
        names += [f"tendons.{name}.{field}" for field in ("tension", "length", *["far_tension"] * tendon.rubs)]
    names += [f"tubes.{name}.{field}" for name in model.scene.tubes for field in ("torque", "angle")]
    names += [f"rings.{name}.{field}" for name in model.scene.rings for field in ("at", "force")]
    names += [f"contacts.{name}.force" for name in model.scene.contacts]
    return [*names, "energy.elastic", "energy.potential"]


def default_motion_results(model: Model, *, forces: bool = False) -> list[str]:
    """Default results of a motion: positions, rotations and velocities of nodes, positions along members, springs,
    what obstacles do, and energies.

    With ``forces`` reactions as well; where several supports hold one rigid body, their forces alone.
    """
    every = [answer_name(name) for name in default_results(model, unique=False)]
    moving = [name.text for name in every if name.kind.table == "nodes" or name.kind.key == "position"]
    sprung = [name.text for name in every if name.kind.table == "springs" and name.kind.key in TRAVELS]
    pushed = [name.text for name in every if name.kind.table == "contacts"]
    energies = [f"energy.{key}" for key in ("kinetic", "elastic", "loads", "total")]
    held = [name for name, node in model.scene.nodes.items() if forces and node.support != "free"]
    keys = {name: ("force",) if shares_rotation(model, name) else ("force", "moment") for name in held}
    reactions = [f"reactions.{name}.{key}" for name, own in keys.items() for key in own]
    return [*moving, *(f"nodes.{name}.velocity" for name in model.nodes), *sprung, *pushed, *energies, *reactions]


TRAVELS = ("angle", "travel")
"""How springs are told of in motions."""


WHOSE = {
    "nodes": "of the node",
    "reactions": "that the ground exerts at the node",
    "members": "of the member",
    "springs": "of the spring",
    "tendons": "of the tendon",
    "tubes": "of the tube",
    "rings": "of the ring",
    "contacts": "of the contact",
    "motions": "of the motion",
    "magnets": "of the magnet",
    "energy": "energy",
}
"""How the meaning of a result goes on after its key."""

BY_FORCES = ("force", "moment", "curvature", "bending_strain", "bending_stress", "strain")
"""Keys of what section forces say along a member."""


class Results:
    """The results of one program.

    Parameters
    ----------
    model : Model
    names : sequence of str
    places : mapping of str to sequence of float
        For each member the fractions of its length at which results are given, unless their name has a place.
    unique : bool
        Whether reactions and section forces are unique: not where constraints depend on each other.
    motion : bool
        Results of a motion: velocities are available, reactions and section forces, which need inertia, are not.

    Attributes
    ----------
    results : tuple of Result
    """

    def __init__(
        self,
        model: Model,
        names: Sequence[str],
        places: Mapping[str, Sequence[float]],
        *,
        motion: bool = False,
        unique: bool = True,
    ) -> None:
        self._motion, self._unique = motion, unique
        self.model, self.places = model, {name: tuple(x) for name, x in places.items()}
        self.results = tuple(self._result(name) for name in names)
        # Where anything is told of, by whatever name.
        self.every = dict(self.places)
        for asked in (result.asked for result in self.results):
            if asked.at is not None:
                self.every[asked.record] = tuple(dict.fromkeys((*self.every.get(asked.record, ()), asked.at)))

    @property
    def size(self) -> int:
        """Number of all their numbers."""
        return sum(result.size for result in self.results)

    # -- what there is ------------------------------------------------------------------------------

    def _result(self, text: str) -> Result:
        name = answer_name(text, "results")
        try:
            self._check(name)
        except SceneError as error:
            message = error.bare if repr(name.quantity) in error.bare else f"{text}: {error.bare}"
            raise SceneError(message, ("results",)) from None
        kind, n = name.kind, 6 if self.model.space else 3
        if not kind.key:
            return Result(text, name, (n, n), kind.unit, f"tangent {kind.table} of {name.record}, {kind.meaning}")
        rows = (len(self.places[name.record]),) if kind.along and name.at is None else ()
        components = kind.components
        if kind.table == "motions" and single_number(self.model.scene.motions[name.record], kind.key):
            components = ()
        columns = (len(components),) if name.component is None and components else ()
        unit = kind.unit
        if kind.table == "springs" and kind.key == "stop":
            unit = "N m" if self.model.scene.springs[name.record].type == "rotational" else "N"
        what = f"{kind.key.replace('_', ' ')} {WHOSE[kind.table]}" + (f" {name.record}" if kind.named else "")
        more = "" if kind.meaning.startswith("of ") else f": {kind.meaning}"
        return Result(text, name, (*rows, *columns), unit or "1", what + more)

    def _check(self, name: AnswerName) -> None:
        """Refuse what is not told of such a model."""
        kind, node, scene = name.kind, name.record, self.model.scene
        if kind.table == "stiffness" and node in scene.nodes and scene.nodes[node].support != "free":
            raise SceneError(f"found a node that the ground holds, accepted: a free one, or compliance.{node}")
        check_answer(scene, name, STEPS if self._motion else PARAMETERS)
        if set(name.selectors) - {"at"} or (name.at is not None and not kind.along):
            raise SceneError(f"found {name.text!r}, accepted: {name.bare}")
        if not self._unique and (kind.table in ("reactions", "motions") or (kind.along and kind.key in BY_FORCES)):
            raise SceneError("not unique as closings depend on each other, accepted: what is")
        if self._motion and kind.key == "moment" and self._held(name) and shares_rotation(self.model, self._held(name)):
            message = (
                "found the moment of one of several supports of a rigid body, which is not told in steps, accepted:"
            )
            raise SceneError(f"{message} its force, or answers of solve(scene)")
        if kind.along:
            flexible = [n for n, record in scene.members.items() if record.type == "flexible"]
            if node not in flexible:
                raise SceneError(unknown(node, flexible, "flexible members"))
            if name.at is not None and not 0.0 <= name.at <= 1.0:
                raise SceneError(f"found {name.at:g}, accepted: fractions of the length, from 0 to 1")
            if node in scene.tubed and kind.key in BY_FORCES[2:]:
                message = f"found the {kind.key.replace('_', ' ')} along a member with tubes, accepted: its position,"
                raise SceneError(f"{message} rotation, force and moment, or answers of solve(scene)")
            section = scene.sections[str(scene.members[node].section)]
            if self._motion and section.relaxation and kind.key in BY_FORCES[2:]:
                message = f"found the {kind.key.replace('_', ' ')} along a member that relaxes, accepted: its force,"
                raise SceneError(f"{message} moment, position and rotation")
            law = section.law
            if law is not None and law.form_in(section).strains and kind.key in BY_FORCES[2:]:
                message = f"found the {kind.key} along a member whose law {law.type!r} depends on its strain, accepted:"
                raise SceneError(f"{message} its force, moment, position and rotation, or answers of solve(scene)")
            if section.stretch_law is not None and kind.key == "strain":
                message = "found the strain along a member with a law of stretch, accepted: its force, or answers of"
                raise SceneError(f"{message} solve(scene)")
        turns = kind.table == "nodes" and kind.key in ("quaternion", "angle")
        if (turns or not kind.key) and node in scene.nodes and self.model.rotations.node_turn[node] is None:
            raise SceneError("found a node that has no rotation of its own")
        if kind.table == "motions":
            motion = scene.motions[node]
            if name.component is not None and single_number(motion, kind.key):
                raise SceneError(f"found {name.bare!r}, which is one number here, accepted: {name.quantity}")

    def _held(self, name: AnswerName) -> str:
        """The node at which the ground makes what is told; empty for what members, joints and terms tell."""
        if name.kind.table == "motions":
            motion = self.model.scene.motions[name.record]
            return motion.node if motion.between is None else ""
        return name.record if name.kind.table == "reactions" else ""

    @property
    def by_inertia(self) -> list[str]:
        """Names of the results that forces of inertia have a share in, of a motion."""
        return [one.name for one in self.results if self._motion and self._held(one.asked)]

    @property
    def strung(self) -> list[str]:
        """Members along which tendons run, whose section forces are asked for."""
        asked = (result.asked for result in self.results if result.asked.kind.along)
        by_forces = dict.fromkeys(name.record for name in asked if name.kind.key in BY_FORCES)
        return [name for name in by_forces if stretches_of(self.model.scene, name)]

    # -- what they are ------------------------------------------------------------------------------

    @property
    def curved(self) -> list[str]:
        """Members whose section data are needed for a result."""
        bent = (result.asked for result in self.results if result.asked.kind.key in BY_FORCES[2:])
        return list(dict.fromkeys(name.record for name in bent))

    @property
    def lawful(self) -> list[str]:
        """Those whose sections have a law."""
        return [name for name in self.curved if law_of(self.model.scene, name) is not None]

    @property
    def touching(self) -> list[str]:
        """Members that touch something, whose lengths say where."""
        return list(dict.fromkeys(member for point in self.model.mesh.points for member in point.members))

    def refuse_places(self) -> None:
        """Refuse to tell where a contact touches that touches at no place, or at several.

        Raises
        ------
        SceneError
            Names the first.
        """
        for result in self.results:
            asked = result.asked
            count = sum(point.contact == asked.record for point in self.model.mesh.points)
            if (asked.kind.table, asked.kind.key) == ("contacts", "at") and count != 1:
                message = (
                    f"found contacts.{asked.record}, which touches at {counted(count, 'place')}, accepted: one that"
                )
                raise SceneError(f"{message} touches at one, or contacts.{asked.record}.force", ("results",))

    @property
    def along(self) -> set[str]:
        """Members along which there are results."""
        return {result.asked.record for result in self.results if result.asked.kind.along}

    def refuse_along(self, members: Iterable[str]) -> None:
        """Refuse results along members whose elements move with a parameter, and with them the places within elements.

        Raises
        ------
        SceneError
            Names the first.
        """
        moving = set(members)
        for result in self.results:
            if result.asked.kind.along and result.asked.record in moving:
                message = (
                    f"found {result.name}, along a member on which a load or a tube moves, accepted: answers of nodes"
                )
                raise SceneError(message, ("results",))

    def rest(self, model: Model) -> Array:
        """Undeformed positions (m) of nodes and places along members, then section data for strains, then lengths (m);
        flat.
        """
        scene = model.scene
        nodes = [numbers(scene.nodes[name].position) for name in model.nodes]
        along = [scene.center_lines[name].positions(np.array(x)) for name, x in self.every.items()]
        sections = [self._sections(model, name).ravel() for name in self.curved]
        sections += [self.strung_data(model, name).ravel() for name in self.strung]
        sections += [law_data(scene, name, np.array(self.every[name])).ravel() for name in self.lawful]
        sections += [numbers([scene.center_lines[name].length]) for name in self.touching]
        return np.concatenate([*nodes, *(part.ravel() for part in along), *sections])

    def strung_data(self, model: Model, member: str) -> Array:
        """Of the tendons along a member at its places, see :func:`~sfetcas.mechanics.tendon_shares.section_data`."""
        return section_data(model, member, np.array(self.every[member]), self.model.scales)

    def _sections(self, model: Model, member: str) -> Array:
        """Of a member at its places, (places, 33 or 42).

        Compliance matrix times the largest stiffness of the first model, curvature times size, axes b1, b2, b3, of a
        shape E and the reach of its fibres, and compliance to forces times the unit of force; where forces bend it, the
        arms by which they do, m.
        """
        scene, x = model.scene, np.array(self.every[member])
        line, section = scene.center_lines[member], scene.sections[str(scene.members[member].section)]
        soft = section.compliance_matrix(x).reshape(len(x), 9) * self._stiffness(member)[:, None]
        axes = np.moveaxis(quaternion.matrix(line.quaternions(x)), 2, 1).reshape(len(x), 9)
        curved = line.curvatures(x) * self.model.scene.size
        fibres = np.zeros((len(x), 3)) if section.shape is None else section.fibres(x)
        yielding = numbers(section.compliance_of_forces(x)).reshape(len(x), 9) * self.model.scales.force
        arms = [section.arms(x).reshape(len(x), 9)] if section.shifted else []
        return np.concatenate([soft, curved, axes, fibres, yielding, *arms], axis=1)

    def shifted(self, member: str) -> bool:
        """Whether forces bend a member."""
        return self.model.scene.members[member].shifted(self.model.scene.sections)

    def width(self, member: str) -> int:
        """How many numbers :meth:`rest` has of the section at each place of a member."""
        return 42 if self.shifted(member) else 33

    def _stiffness(self, member: str) -> Array:
        """Largest stiffness of the first model at the places of a member, (places,), N m2."""
        scene = self.model.scene
        values = scene.sections[str(scene.members[member].section)].stiffness(np.array(self.every[member]))
        return numbers(np.nanmax(values, axis=1))

    def lengths(self, member: str) -> Array:
        """Lengths (elements,) of the elements of a member, dimensionless."""
        return np.asarray(values_of(self.model.beams.weight[self.model.elements_of(member)])).sum(axis=1)

    def about(self, moment: ca.MX, force: ca.MX, axes: Callable[[ca.MX], ca.MX], sections: ca.MX) -> ca.MX:
        """What bends sections, about their axes, with what forces do by their arms, (3, places), N m.

        Parameters
        ----------
        moment, force : (3, places), N m and N, fixed axes
        axes : function that rotates vectors (3, places) with the sections
        sections : (33 or 42, places), their data as of :meth:`rest`
        """
        turned = [axes(sections[12 + 3 * k : 15 + 3 * k, :]) for k in range(3)]
        about = [ca.sum1(axis * moment) for axis in turned]
        if sections.shape[0] > 33:
            along = [ca.sum1(axis * force) for axis in turned]
            about = [
                own + sum((sections[33 + 3 * i + k, :] * along[i] for i in range(3)), ca.MX(0))
                for k, own in enumerate(about)
            ]
        return ca.vertcat(*about)

    def bent(self, member: str, about: ca.MX, sections: ca.MX) -> ca.MX:
        """Change of the curvature about the axes of the sections, (3, places), 1/m, by moments about them, N m."""
        inverse = ca.DM(1.0 / self._stiffness(member)).T
        return ca.vertcat(
            *(sum((sections[3 * k + j, :] * about[j, :] for j in range(3)), ca.MX(0)) * inverse for k in range(3))
        )

    def touches(self, program: Program, rest: ca.MX, points: Sequence[ContactPoint]) -> ca.MX:
        """Where points on obstacles are, fractions (points,) of the lengths of their members."""
        outputs = Outputs(self, program, rest)
        return ca.densify(ca.vertcat(ca.MX(0, 1), *(outputs.place(point, 0) for point in points)))

    def expression(self, program: Program, rest: ca.MX, moving: Moving | None = None) -> ca.MX:
        """All results (size,), one after the other, each row by row, in SI units."""
        outputs = Outputs(self, program, rest, moving)
        found = ca.vertcat(*(ca.densify(ca.vec(outputs.value(result.asked).T)) for result in self.results))
        # Where a magnet is beyond the table of a field there are no answers.
        beyond = outputs.beyond()
        return found if beyond is None else ca.if_else(beyond > tolerances.WRITTEN, np.nan, found)


class Moving(NamedTuple):
    """What a motion tells beside its state.

    Attributes
    ----------
    speeds : MX (axes, places)
        Velocities of places, m/s.
    kinetic : MX
        Kinetic energy, dimensionless.
    balance : Stationarity
        The equations with forces of inertia and dampers.
    taken : MX (full coordinates,)
        What these forces take from rotations and places beside.
    """

    speeds: ca.MX
    kinetic: ca.MX
    balance: Stationarity
    taken: ca.MX


class Outputs:
    """The values of results.

    Parameters
    ----------
    results : Results
    program : Program
    rest : MX
        As of :meth:`Results.rest`.
    moving : Moving, optional
        What a motion tells beside its state.
    """

    def __init__(self, results: Results, program: Program, rest: ca.MX, moving: Moving | None = None) -> None:
        self._moving = moving
        self._results, self._program = results, program
        self._model, self._expressions = program.model, program.expressions
        model, expressions = self._model, self._expressions
        self._q, self._y, self._lam, self._unwrapped = program.parts
        places = expressions.displacements(self._q, self._y, program.given)
        self._places = ca.reshape(places, expressions.axes, expressions.places)
        self._found = program.forces if moving is None else moving.balance
        count = len(model.nodes)
        along = [len(x) for x in results.every.values()]
        curved = [results.width(name) * len(results.every[name]) for name in results.curved]
        strung = [results.strung_data(model, name).shape for name in results.strung]
        lawful = [law_data(model.scene, name, np.array(results.every[name])).shape for name in results.lawful]
        tables = [3 * count, *(3 * n for n in along), *curved, *(a * b for a, b in (*strung, *lawful))]
        touching = results.touching
        nodes, *members = ca.vertsplit(rest, np.cumsum([0, *tables, *(1 for _ in touching)]).tolist())
        members, lengths = members[: len(tables) - 1], members[len(tables) - 1 :]
        self._lengths = dict(zip(touching, lengths, strict=True))
        sections = members[len(along) : len(along) + len(curved)]
        pairs = zip((*strung, *lawful), members[len(along) + len(curved) :], strict=True)
        others = [ca.reshape(x, shape[1], shape[0]) for shape, x in pairs]
        self._tendons = dict(zip(results.strung, others, strict=False))
        self._laws = dict(zip(results.lawful, others[len(strung) :], strict=True))
        self._sections = {n: ca.reshape(x, results.width(n), -1) for n, x in zip(results.curved, sections, strict=True)}
        self._rest = ca.reshape(nodes, 3, count)
        self._along = {n: ca.reshape(x, 3, -1) for n, x in zip(results.every, members, strict=False)}
        if expressions.elements:
            self._tangents = expressions.tangents(self._q, places, program.given)

    def beyond(self) -> ca.MX | None:
        """How far magnets are beyond the tables of fields, over their sizes; None without tables."""
        scene = self._model.scene
        if not any(field.table is not None for field in scene.fields.values()):
            return None
        own = [(n, i) for name in scene.magnets for n, which in magnet_terms(self._model.terms, name) for i in which]
        return ca.mmax(ca.vertcat(0.0, *(self._told(n, i, "beyond") for n, i in own)))

    def value(self, name: AnswerName) -> ca.MX:
        """A result as a matrix of its rows and columns."""
        found = self._whole(name)
        if name.kind.along:
            places = self._results.every[name.record]
            fractions = self._results.places[name.record] if name.at is None else [name.at]
            found = found[[places.index(x) for x in fractions], :]
        return found if name.component is None else found[:, name.component]

    def _whole(self, name: AnswerName) -> ca.MX:
        """A result at all places, with all components."""
        kind, record, key = name.kind, name.record, name.kind.key
        if kind.table == "energy":
            strain, potential = self._program.strain, self._program.potential
            kinetic = ca.MX(0) if self._moving is None else self._moving.kinetic
            energies = {"elastic": strain, "kinetic": kinetic, "loads": potential - strain, "potential": potential}
            return energies.get(key, kinetic + potential) * self._model.scales.moment
        if not key:
            return self._tangent(kind.table, record)
        if kind.table == "springs":
            return self._stopped(record) if key == "stop" else self._connection("springs", record, key)
        if kind.table == "magnets":
            return self._magnet(record, key)
        if kind.table == "tendons":
            return self._tendon(record, key)
        if kind.table == "tubes":
            return self._tube(record, key)
        if kind.table == "rings":
            return self._ring(record, key)
        if kind.table == "contacts":
            return self._contact(record, key)
        tables = {"nodes": self._node, "reactions": self._reaction, "members": self._member, "motions": self._motion}
        return tables[kind.table](record, key)

    def _three(self, vectors: ca.MX) -> ca.MX:
        return vectors if self._model.space else ca.vertcat(vectors, ca.MX.zeros(1, vectors.shape[1]))

    def _about(self, moments: ca.MX) -> ca.MX:
        """Moments about the axes that turn with three components."""
        return ca.vertcat(ca.MX.zeros(3 - moments.shape[0], moments.shape[1]), moments)

    def _node(self, node: str, key: str) -> ca.MX:
        number = self._model.nodes.index(node)
        if key == "velocity":
            assert self._moving is not None
            return self._three(self._moving.speeds[:, number]).T
        if key == "position":
            moved = self._three(self._places[:, number]) * self._model.scales.length
            return (self._rest[:, number] + moved).T
        turn = self._model.rotations.node_turn[node]
        assert turn is not None
        return self._rotated(self._q[:, turn].T, key)

    def _rotated(self, rotations: ca.MX, key: str) -> ca.MX:
        """Rotations (n, components) as quaternions, also in the plane, or as angles."""
        if key == "angle" or self._model.space:
            return rotations
        nothing = ca.MX.zeros(rotations.shape[0], 2)
        return ca.horzcat(ca.cos(0.5 * rotations), nothing, ca.sin(0.5 * rotations))

    # -- reactions ----------------------------------------------------------------------------------

    @functools.cached_property
    def _reactions(self) -> Reactions:
        return Reactions(self._expressions.tables)

    @functools.cached_property
    def _cells(self) -> ca.MX:
        """What all terms take, loads among them."""
        return ca.vertcat(*(ca.vec(values) for _, values in self._found.shares))

    def _reaction(self, node: str, key: str) -> ca.MX:
        model, reactions, closings = self._model, self._reactions, len(self._model.positions.rows)
        left, first = times(reactions.left, self._cells), self._expressions.of_places
        if self._moving is not None:
            left += self._moving.taken
        if key == "force":
            on_places = left[first:] + self._found.on_places
            forces = times(reactions.forces, ca.vertcat(on_places, self._lam[:closings, :]))
            force = ca.reshape(forces, self._expressions.axes, -1)[:, model.segments.place(node)]
            return ca.mtimes(ca.DM(reactions.pushed(node)), self._three(force)).T * model.scales.force
        if shares_rotation(model, node):
            cells = ca.vertcat(self._cells, ca.MX(reactions.rigid.known.shape[1] - reactions.cells, 1))
            known = ("node", node) in reactions.rigid.unknowns
            found = times(reactions.rigid.share(node), cells) if known else ca.MX.zeros(3)
            return self._about(found).T * model.scales.moment
        moments = self._about(ca.reshape(left[:first], self._expressions.turns, -1))
        parts = (ca.mtimes(ca.DM(fixed), moments[:, turn]) for turn, fixed in reactions.turned(node))
        return sum(parts, ca.MX.zeros(3)).T * model.scales.moment

    def _motion(self, name: str, key: str) -> ca.MX:
        """What makes a motion: the multiplier of a driven joint, or what the ground does, also about an axis alone."""
        motion = self._model.scene.motions[name]
        if motion.between is not None:
            return self._connection("motions", name, key)
        found = self._reaction(motion.node, key)
        if not single_number(motion, key):
            return found
        axis = np.asarray(self._model.scene.nodes[motion.node].turn_axis, dtype=float)
        return ca.mtimes(found, ca.DM(axis / np.linalg.norm(axis)))

    # -- members ------------------------------------------------------------------------------------

    def _stations(self, member: str) -> Stations:
        return Stations(self._model.element, self._model.mesh.cuts[member], np.array(self._results.every[member]))

    def _points(self, values: ca.MX, member: str, weights: Array) -> ca.MX:
        """Sums over the points of the elements of a member, (axes, places), by weights (places, points of all)."""
        first = self._model.elements_of(member)
        n = self._expressions.points
        return ca.mtimes(values[:, first.start * n : first.stop * n], ca.sparsify(ca.DM(weights)).T)

    def _up_to(self, member: str) -> Array:
        """Weights that integrate from the start of a member to its places, (places, points of all elements)."""
        at, n = self._stations(member), self._expressions.points
        weights = self._within(member, at.gained)
        for row, element in enumerate(at.elements.tolist()):
            weights[row, : element * n] = 1.0
        return weights

    def _within(self, member: str, rows: Array) -> Array:
        """Weights of the points of the element of each place, (places, points of all elements)."""
        e = self._stations(member).elements
        n, part = self._expressions.points, self._model.elements_of(member)
        weights = np.zeros((len(e), (part.stop - part.start) * n))
        for row, (element, own) in enumerate(zip(e, rows, strict=True)):
            weights[row, element * n : (element + 1) * n] = own
        return weights

    def _member(self, member: str, key: str) -> ca.MX:
        model, scales = self._model, self._model.scales
        if key == "position":
            moved = self._points(self._tangents - self._program.given.tangent, member, self._up_to(member))
            start = self._places[:, model.segments.place(model.segments.ends[member, 0])]
            moved += ca.repmat(start, 1, moved.shape[1])
            return (self._along[member] + self._three(moved) * scales.length).T
        if key in ("quaternion", "angle"):
            return self._rotated(self._rotations(member), key)
        if key == "energy":
            return self._strain_energy(member)
        if key == "strain":
            return self._stretch(member)
        if key in BY_FORCES[2:]:
            return self._curvature(member, key)
        return (self._force(member) * scales.force if key == "force" else self._moment(member) * scales.moment).T

    def _strain_energy(self, member: str) -> ca.MX:
        if member not in self._model.members:
            return self._connection("members", member, "energy")
        return ca.sum2(self._program.strains[:, self._model.elements_of(member)]) * self._model.scales.moment

    def _stretch(self, member: str) -> ca.MX:
        """Stretch and shear along the axes of the sections, (places, 3)."""
        sections, force, axes = self._sections[member], self._force(member), self._expressions.axes
        function = self._expressions.many(turned_vector(self._model.space), force.shape[1])
        along = [sections[12 + 3 * k : 15 + 3 * k, :] for k in range(3)]
        along = [function(self._rotations(member).T, each[:axes, :]) for each in along]
        along = [ca.sum1(each * force[:axes, :]) for each in along]
        rows = [sum((sections[24 + 3 * k + j, :] * along[j] for j in range(3)), ca.MX(0)) for k in range(3)]
        if self._results.shifted(member):
            change = self._change(member)
            arms = sections[33:, :]
            rows = [row + ca.sum1(arms[3 * k : 3 * k + 3, :] * change) for k, row in enumerate(rows)]
        return ca.vertcat(*rows).T

    def _change(self, member: str) -> ca.MX:
        """Change of the curvature about the axes of the sections, (3, places), 1/m."""

        def turned(vectors: ca.MX) -> ca.MX:
            space = self._model.space
            if not space and not self._results.shifted(member):
                # About z nothing in the plane counts, and z turns to itself.
                return vectors
            function, q = self._expressions.many(turned_vector(space), vectors.shape[1]), self._rotations(member).T
            return function(q, vectors) if space else ca.vertcat(function(q, vectors[:2, :]), vectors[2, :])

        moment, sections = self._moment(member) * self._model.scales.moment, self._sections[member]
        force = self._force(member) * self._model.scales.force if self._results.shifted(member) else moment
        about = self._results.about(moment, force, turned, sections)
        return self._by_law(member, about) if member in self._laws else self._results.bent(member, about, sections)

    def _curvature(self, member: str, key: str) -> ca.MX:
        """Curvature (places, 3), or strain or stress by its change (places,)."""
        change, sections, scene = self._change(member), self._sections[member], self._model.scene
        if key == "curvature":
            return (sections[9:12, :] / scene.size + self._natural(member) + change).T
        shape = scene.sections[str(scene.members[member].section)].shape
        strain = self._expressions.many(fibre_strain(shape != "rectangle"), change.shape[1])(change, sections[22:24, :])
        return (strain * sections[21, :] if key == "bending_stress" else strain).T

    def _by_law(self, member: str, moment: ca.MX) -> ca.MX:
        """Change of the curvature (3, places), 1/m, at which the law of a section gives moments about its axes."""
        model, sections, law = self._model, self._sections[member], law_of(self._model.scene, member)
        assert law is not None
        spin = self._about(self._spins(member)) / model.scales.length
        near = ca.vertcat(*(ca.sum1(sections[12 + 3 * k : 15 + 3 * k, :] * spin) for k in range(3)))
        axes = (0, 1, 2) if model.space else (model.scene.center_lines[member].bending_axis - 1,)
        return self._expressions.many(bent_by(law.form, axes), moment.shape[1])(moment, near, self._laws[member])

    def _spins(self, member: str) -> ca.MX:
        """Change of the curvature as elements say, about the fixed axes of the undeformed scene, (turns, places)."""
        model, at = self._model, self._stations(member)
        nodes = model.rotations.turns[model.elements_of(member)][at.elements]
        lengths = np.asarray(self._results.lengths(member))[at.elements]
        pairs = zip(nodes, at.slopes / lengths[:, None], strict=True)
        slope = ca.horzcat(*(ca.mtimes(self._q[:, t.tolist()], ca.DM(row)) for t, row in pairs))
        if not model.space:
            return slope
        return self._expressions.many(spin_of(), len(nodes))(self._rotations(member).T, slope)

    def _natural(self, member: str) -> ca.MX:
        """Natural twist and curvature, (3, places), 1/m, section axes, that actuations add."""
        fixed, sections = self._natural_about(member), self._sections[member]
        rows = [ca.sum1(sections[12 + 3 * k : 15 + 3 * k, :] * fixed) for k in range(3)]
        return ca.vertcat(*rows) / self._model.scales.length

    def _natural_about(self, member: str) -> ca.MX:
        """The same about the fixed axes of the undeformed scene, (3, places), dimensionless."""
        model, expressions, at = self._model, self._expressions, self._stations(member)
        part, n = model.elements_of(member), expressions.points
        values = ca.MX(expressions.turns, n * (part.stop - part.start))
        for number, group in enumerate(model.terms):
            if group.kind.table != "actuations":
                continue
            of_element = group.elements - part.start
            own = np.flatnonzero((of_element >= 0) & (of_element < part.stop - part.start))
            if len(own):
                points = (of_element[own][:, None] * n + np.arange(n)).ravel()
                every = (own[:, None] * n + np.arange(n)).ravel()
                load = ca.reshape(expressions.load(number, self._program.given), expressions.turns, -1)
                onto = sparse(np.arange(len(points)), points, np.ones(len(points)), (len(points), values.shape[1]))
                values += ca.mtimes(load[:, every.tolist()], onto)
        return self._about(ca.mtimes(values, ca.sparsify(ca.DM(self._within(member, at.at_points))).T))

    def _rotations(self, member: str) -> ca.MX:
        model, at = self._model, self._stations(member)
        turns = model.rotations.turns[model.elements_of(member)][at.elements]
        found = [ca.mtimes(self._q[:, t.tolist()], ca.DM(row)) for t, row in zip(turns, at.nodal, strict=True)]
        found = [one / ca.norm_2(one) for one in found] if model.space else found
        return ca.horzcat(*found).T

    @functools.cached_property
    def _spread(self) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Distributed forces at the points of all elements, the whole pull there (axes, points), couples of loads."""
        spread, pull, torque = spread_of(self._expressions, self._q, self._y, self._program.given)
        pull = self._found.pull + pull + self._on_points(self._found.strings + self._found.along)
        if not self._pressed:
            return spread, pull, torque
        n, element = self._expressions.points, self._model.element
        pressed = ca.MX.zeros(self._expressions.axes, n * self._expressions.elements)
        for group, forces in self._pressed:
            points = (n * group.elements[:, None] + np.arange(n)).ravel()
            onto = sparse(np.arange(len(points)), points, np.ones(len(points)), (len(points), pressed.shape[1]))
            pressed += ca.mtimes(forces[: self._expressions.axes, :], onto)
        # Elements on lines begin at places, so that none carries what presses on others.
        within = np.kron(np.eye(self._expressions.elements), element.to_points / element.weights)
        return spread + pressed, pull - ca.mtimes(pressed, ca.sparsify(ca.DM(within))), torque

    @functools.cached_property
    def _pressed(self) -> list[tuple[Group, ca.MX]]:
        """Groups of terms that tell what presses along lines, and that at the points of their elements, one after the
        other, (3, points of all), dimensionless.
        """
        expressions, model, found = self._expressions, self._model, list[tuple[Group, ca.MX]]()
        for number, group in enumerate(model.terms):
            if group.kind.table == "contacts" and any(key.startswith("push x at") for key in group.kind.answers):
                sides = expressions.arguments(number, self._q, self._places, self._program.given, self._unwrapped)
                lam = expressions.multipliers(number, self._lam)
                told = expressions.many(answers_of(group.kind), len(group.data))(*sides, lam)
                found.append((group, ca.reshape(told, 3, -1)))
        return found

    def _on_points(self, values: ca.MX) -> ca.MX:
        """What is the same all along each element, (axes, elements), at its points."""
        each = np.repeat(np.arange(self._expressions.elements), self._expressions.points)
        return values[:, each.tolist()]

    def _force(self, member: str) -> ca.MX:
        """Internal force at the places, (3, places)."""
        at, n = self._stations(member), self._expressions.points
        spread, pull, _ = self._spread
        first = (n * (self._model.elements_of(member).start + at.elements)).tolist()
        found = self._three(self._points(spread, member, self._within(member, at.spread)) - pull[:, first])
        found -= self._three(ca.horzcat(ca.MX(self._expressions.axes, 0), *self._pushed(member)[0]))
        return found - self._strung(member)[1] if member in self._tendons else found

    def _moment(self, member: str) -> ca.MX:
        """Section moment at the places, (3, places)."""
        return self._strung(member)[0] if member in self._tendons else self._cut(member)

    def _strung(self, member: str) -> tuple[ca.MX, ca.MX]:
        """Section moment, and force of tendons along a member, at the places, (3, places) each."""
        model, at, moment = self._model, self._stations(member), self._cut(member)
        turns, guess = self._expressions.turns, self._spins(member)
        pieces = stretches_of(model.scene, member)
        tensions = ca.vertcat(*(self._tensions(name, piece) for name, piece in pieces)) / model.scales.force
        q, n = self._rotations(member).T, len(at.elements)
        back = moment[3 - turns :, :]
        if model.space:
            opposite = ca.vertcat(q[0, :], -q[1:, :])
            back = self._expressions.many(turned_vector(True), n)(opposite, moment)
        function = self._expressions.many(share_of(model.space, len(pieces), NEWTON_STEPS), n)
        natural, strain = self._natural_about(member)[3 - turns :, :], self._strain(member)
        about, along = function(back, guess, natural, strain, self._tendons[member], tensions)
        turned = self._expressions.many(turned_vector(model.space), n)
        force = self._three(turned(q, along))
        return moment - (turned(q, about) if model.space else self._about(about)), force

    def _tensions(self, name: str, piece: Stretch) -> ca.MX:
        """Tension of a tendon along a member at its places, (1, places), N."""
        model, at = self._model, self._stations(piece.member)
        if not model.scene.tendons[name].rubs:
            return ca.repmat(self._tendon(name, "tension"), 1, len(at.elements))
        number = model.scene.tendon_pieces[name].index(piece)
        rigid = model.scene.members[piece.member].type == "rigid"
        first, found = model.elements_of(piece.member).start, list[ca.MX]()
        for element, weights in zip(at.elements.tolist(), at.at_points, strict=True):
            group, i = part_of(model, name, number, -1 if rigid else first + element)
            keys = [key for key in model.terms[group].kind.answers if key.startswith("tension at")] if i >= 0 else []
            values = [self._told(group, i, key) for key in keys]
            # Along what is rigid it is that where it begins.
            share = [1.0] if rigid else weights.tolist()
            found.append(sum((w * value for w, value in zip(share, values, strict=False)), ca.MX(0.0)))
        return ca.horzcat(*found)

    def _strain(self, member: str) -> ca.MX:
        """What stretch and shear add to the unit tangent before it is turned, (axes, places)."""
        model, axes, at = self._model, self._expressions.axes, self._stations(member)
        if not model.element.strains:
            return ca.MX.zeros(axes, len(at.elements))
        strains = self._places[:, np.maximum(model.segments.strains, 0).ravel().tolist()]
        columns = ca.vertsplit(self._program.given.compliance, axes)[:axes]
        gained = sum((ca.repmat(strains[j, :], axes, 1) * column for j, column in enumerate(columns)), ca.MX(0))
        weights = ca.DM(values_of(model.beams.weight).reshape(1, -1))
        return self._points(gained / ca.repmat(weights, axes, 1), member, self._within(member, at.at_points))

    def _cut(self, member: str) -> ca.MX:
        """Moment through cuts, (3, places): that at the first node of the element, and what forces add."""
        expressions, model = self._expressions, self._model
        at = self._stations(member)
        first = expressions.points * (model.elements_of(member).start + at.elements)
        own = self._found.moments(first)
        _, pull, torque = self._spread
        own += self._crossed(self._on_points(self._found.strings))[:, first.tolist()]
        gained = self._points(self._crossed(pull) - torque, member, self._within(member, at.gained)) - own
        return self._about(gained + ca.horzcat(ca.MX(expressions.turns, 0), *self._pushed(member)[1]))

    def _pushed(self, member: str) -> tuple[list[ca.MX], list[ca.MX]]:
        """Of each place of a member what rings, and what touches it, before it in its element add to force and moment
        there.
        """
        model, at, expressions = self._model, self._stations(member), self._expressions
        cuts, n, begin = model.mesh.cuts[member], expressions.points, model.elements_of(member).start
        forces = [ca.MX.zeros(expressions.axes) for _ in at.elements]
        moments = [ca.MX.zeros(expressions.turns) for _ in at.elements]
        rings = [name for name, ring in model.scene.rings.items() if ring.member == member]
        pushes = [(self._ring(name, "at"), self._ring(name, "force")) for name in rings]
        sides = [(p, i) for p in model.mesh.points for i, touching in enumerate(p.members) if touching == member]
        # Where elements end it pushes a place between them.
        inside = [(p, i) for p, i in sides if standing(model.mesh, p, i) is None]
        pushes += [(self.place(p, i), (1.0 - 2.0 * i) * self._force_at(p)) for p, i in inside]
        for place, force in pushes:
            push = force[: expressions.axes] / model.scales.force
            for i, (element, xi) in enumerate(zip(at.elements.tolist(), at.xi.tolist(), strict=True)):
                start, end = cuts[element], cuts[element + 1]
                here = (place - start) / (end - start)
                inside = here < xi if element == 0 else ca.logic_and(here > 0.0, here < xi)
                points = slice(n * (begin + element), n * (begin + element + 1))
                arm = ca.mtimes(self._tangents[:, points], ca.DM(at.gained[i]) - up_to(model.element, here))
                about = ca.cross(arm, push) if model.space else arm[0] * push[1] - arm[1] * push[0]
                forces[i] += ca.if_else(inside, push, 0.0)
                moments[i] += ca.if_else(inside, about, 0.0)
        return forces, moments

    def _crossed(self, pull: ca.MX) -> ca.MX:
        """Cross products of the tangents of all points with what pulls there, (turns, points)."""
        if self._model.space:
            return ca.cross(self._tangents, pull, 1)
        return self._tangents[0, :] * pull[1, :] - self._tangents[1, :] * pull[0, :]

    # -- springs ------------------------------------------------------------------------------------

    def _connection(self, table: str, name: str, key: str) -> ca.MX:
        """What the connection of a name tells."""
        groups = self._model.terms
        number, i = next(x for x in connections_of(groups, table, name) if key in groups[x[0]].kind.answers)
        return self._told(number, i, key)

    def _stopped(self, name: str) -> ca.MX:
        """What the stop of a spring adds to its moment or force."""
        rotational, names = self._model.scene.springs[name].type == "rotational", self._model.row_names
        found = [self._lam[names.index(row)] for side in SIDES if (row := row_of("springs", name, side)) in names]
        return -sum(found, ca.MX(0)) * (self._model.scales.moment if rotational else self._model.scales.force)

    def _told(self, number: int, i: int, key: str) -> ca.MX:
        """A quantity of one term of a group."""
        expressions, given, group = self._expressions, self._program.given, self._model.terms[number]
        turns, places, _, _, _ = group.kind.sizes
        turned, moved = expressions.sides(group, self._q, ca.vec(self._places))
        found = answers_of(group.kind)(
            turned[:, turns * i : turns * (i + 1)],
            moved[:, places * i : places * (i + 1)],
            expressions.data(number, given, self._unwrapped)[:, i],
            expressions.load(number, given)[:, i],
            expressions.multipliers(number, self._lam)[:, i],
        )
        k = list(group.kind.answers).index(key)
        return found[k] * self._model.scales.of(group.kind.answers[key])

    def _magnet(self, name: str, key: str) -> ca.MX:
        """Energy, torque or force that fields give a magnet."""
        expressions, model, total = self._expressions, self._model, ca.MX.zeros(8)
        given, places = self._program.given, expressions.retained_places(self._y, self._program.given)
        for connection, own in magnet_terms(model.connections, name):
            number, group = connection + 1, model.connections[connection]
            arguments = [*expressions.arguments(number, self._q, places, given, self._unwrapped)]
            nothing = ca.MX(0, len(group.data))
            found = expressions.many(answers_of(group.kind), len(group.data))(*arguments, nothing)
            total += ca.sum2(found[:, own])
        rows, unit = {
            "energy": (slice(0, 1), model.scales.moment),
            "torque": (slice(1, 4), model.scales.moment),
            "force": (slice(4, 7), model.scales.force),
        }[key]
        return total[rows].T * unit

    def _tendon(self, name: str, key: str) -> ca.MX:
        """Tension, or length as the sum over its parts."""
        found = []
        for number, group in enumerate(self._model.terms):
            told = group.kind.table == "tendons" and key in group.kind.answers
            own = [i for i, each in enumerate(group.names) if each == name and told]
            found += [self._told(number, i, key) for i in own[: None if key == "length" else 1]]
        return sum(found[1:], found[0]) if key == "length" else found[0]

    def _tube(self, name: str, key: str) -> ca.MX:
        """Angle at the front end, or torque or energy as the sum over the parts."""
        found = []
        for number, group in enumerate(self._model.terms):
            own = [i for i, each in enumerate(group.names) if each == name and group.kind.table == "tubes"]
            last = own[-1:] if group.kind.along_element else []
            found += [self._told(number, i, key) for i in (last if key == "angle" else own)]
        return sum(found[1:], found[0])

    def _ring(self, name: str, key: str) -> ca.MX:
        """Place of a ring along its member, its force on it, or the force that drives it."""
        if key == "drive":
            return self._connection("rings", name, key)
        if key == "force":
            return ca.vertcat(*[self._connection("rings", name, f"force {axis}") for axis in "xyz"])
        scene = self._model.scene
        length = scene.center_lines[scene.rings[name].member].length
        return scene.ring_places[name] + self._connection("rings", name, "moved") / length

    def _contact(self, name: str, key: str) -> ca.MX:
        """The resultant of what a contact does, or where it touches at one place alone."""
        points = [point for point in self._model.mesh.points if point.contact == name]
        if key == "force":
            stopped = [
                ca.horzcat(*(self._told(number, i, each) for each in group.kind.answers))
                for number, group in enumerate(self._model.terms)
                for i in np.flatnonzero((np.array(group.names) == name) & group.kind.on_face).tolist()
            ]
            return sum([*(self._force_at(point).T for point in points), *stopped], ca.MX.zeros(1, 3))
        return self.place(points[0], 0) if len(points) == 1 else ca.MX(np.nan)

    def _force_at(self, point: ContactPoint) -> ca.MX:
        """Force (3,), N, at a place that touches on the first member, or of what stands for a part of a line."""
        if point.line:
            n, total = self._expressions.points, ca.MX.zeros(3)
            for group, forces in self._pressed:
                own = np.flatnonzero(np.array(group.names) == point.name)
                total += ca.sum2(forces[:, (n * own[:, None] + np.arange(n)).ravel().tolist()])
            return total * self._model.scales.force
        return ca.vertcat(*[self._connection("contacts", point.name, f"force {axis}") for axis in "xyz"])

    def push(self, point: ContactPoint) -> ca.MX:
        """How hard a place that touches pushes, N."""
        return self._connection("contacts", point.name, "push")

    def place(self, point: ContactPoint, side: int) -> ca.MX:
        """Where a place that touches is on a member, a fraction of its length."""
        moved = self._connection("contacts", point.name, f"moved on {('first', 'second')[side]}")
        return point.at[side] + moved / self._lengths[point.members[side]]

    # -- stiffness ----------------------------------------------------------------------------------

    def _tangent(self, kind: str, node: str) -> ca.MX:
        """Tangent stiffness or compliance of a node: displacements, then rotations."""
        model, expressions, program = self._model, self._expressions, self._program
        number, axes = model.rotations.node_turn[node], expressions.axes
        assert number is not None
        step = ca.MX.sym("step", expressions.total)
        moved = program.moved_expression(step)
        place = model.segments.place(node)
        at = expressions.displacements(*moved[:2], program.given)[axes * place : axes * (place + 1)]
        spin = expressions.spins(step)[:, number]
        jacobian = ca.substitute([ca.jacobian(ca.vertcat(at, spin), step)], [step], [ca.DM.zeros(expressions.total)])[0]
        compliance = ca.mtimes(jacobian, ca.solve(program.matrix, ca.densify(jacobian).T, "qr", {"eps": 1e-300}))
        units = np.repeat([model.scales.length, 1.0], [axes, expressions.turns])
        loads = np.repeat([model.scales.force, model.scales.moment], [axes, expressions.turns])
        found = ca.DM(units[:, None] / loads[None, :]) * compliance
        return found if kind == "compliance" else ca.solve(found, ca.DM.eye(len(units)), "qr", {"eps": 1e-300})
