"""Positions, rotations, section forces and moments along the members of a state, at any place.

Section forces and moments come from equilibrium, not from the derivative of the rotations: the moment at the
first node of a member is minus the gradient of its energy there, and the rest follows by integrating
``m' = -r' x n``.  They are therefore as accurate as the positions, of order 2p at the element ends.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .. import tolerances
from ..description.answers import single_number
from ..description.obstacles import Obstacle
from ..description.records import enumerated
from ..description.tendons import Stretch
from ..errors import SolveError, Status
from ..mathematics import curves, quaternion
from ..mathematics.arrays import TINY, Array, Index, first_of_largest, values_of
from ..mathematics.interpolation import differentiation, evaluation
from ..mathematics.keeping import kept
from .balance import Balance, SpringState
from .balance import three as _three
from .batches import GroupBatch
from .equations import Equations, State, gained_tangents, scaled_strains, turned_points, turned_tangents, yielded
from .laws import curvature_by_moment, form_of
from .load_terms import pull_within
from .loading import Loading
from .magnetism import magnet_terms
from .memory import dissipated_along
from .mesh import ContactPoint, within_elements
from .relaxation import carried, relax
from .segments import SAME_CUT, beside_line, pulled_place, standing
from .singles import fibre_strain
from .stations import Stations
from .stretch_laws import strain_by_force
from .tendon_chains import is_let_out, settle, turned_since
from .tendon_shares import NEWTON_STEPS, section_data, share_of, stretches_of
from .terms import answers_of, energies_of
from .tube_fields import fields_of_tube, places_along
from .tubes import angles_like, moments_of

__all__ = ["Fields", "rotations_along", "strained_like", "transferred"]

LARGE = 1.0
"""Displacement over size, or rotation in rad, of a small member at which its results are refused as meaningless."""


MEMBERS = 64
"""Number of members whose intermediate results are cached, since reports ask for one member after the other."""

SLIDES = 1e-6
"""Share of the limit of friction by which friction is below it where what touches is said to stick."""


class Fields:
    """Evaluates a state of a model.

    Results are in SI units and fixed axes with three components, unless the docstring says "dimensionless".

    Parameters
    ----------
    equations : Equations
    state : State
    loading : Loading
    balanced : callable, optional
        Gives the same state with multipliers, and the loading with what inertia and dampers do, when these are first
        asked for: places and rotations do without.
    """

    def __init__(
        self,
        equations: Equations,
        state: State,
        loading: Loading,
        balanced: Callable[[], tuple[State, Loading]] | None = None,
    ) -> None:
        self.model, self._equations, self._placed = equations.model, equations, state
        self._balanced, self.q, model = balanced or (lambda: (state, loading)), state.q, self.model
        self.turned = turned_tangents(model, state)
        gained = (self.turned - model.beams.tangent).sum(axis=1)
        nodal, _ = equations.displacements(state, loading, gained)
        self._nodal = nodal.reshape(len(model.segments.places), -1)

    @functools.cached_property
    def _in_balance(self) -> tuple[State, Loading]:
        return self._balanced()

    @property
    def state(self) -> State:
        """Unknowns and multipliers, dimensionless."""
        return self._in_balance[0]

    @property
    def loading(self) -> Loading:
        """Loads and prescribed displacements, dimensionless."""
        return self._in_balance[1]

    @functools.cached_property
    def _loading(self) -> Loading:
        return self._equations.acting(*self._in_balance)

    @property
    def displaced(self) -> Array:
        """Displacements (places, axes) of the places of the model, dimensionless."""
        return self._nodal

    @functools.cached_property
    def _pull(self) -> Array:
        """Minus the internal force at the points of elements (elements, points, axes), without that of strings.

        Of an element along which rings are it is that before the first of them.
        """
        carried = self._equations.segment_pulls(self.state.lam, self._loading)[self.model.segments.owner]
        pull = self._loading.pull + (carried + self._strings + self._ringed)[:, None, :]
        if self.model.mesh.lies:
            # Elements on lines begin at places, so that none carries what presses on others.
            pull = pull + pull_within(self._pressing, self.model.element)
        return np.asarray(pull)

    def carried_to(self, model: Any) -> tuple[Index, Array]:
        """Rows (n,) of another model of the scene that close segments, and their multipliers (n,): what these carry at
        their ends in this state, wherever other segments end.
        """
        rows = np.flatnonzero(model.positions.closes >= 0)
        pulls = self._equations.segment_pulls(self.state.lam, self._loading)
        segments, within, found = self.model.segments, self._loading.pull, [np.zeros(0)]
        for number in dict.fromkeys(model.positions.closes[rows].tolist()):
            part = model.segments.parts[number]
            mine, its = (one.elements_of(part.member).start for one in (self.model, model))
            end = model.mesh.cuts[part.member][part.elements.stop - its]
            last = mine + int(np.searchsorted(self.model.mesh.cuts[part.member], end - SAME_CUT)) - 1
            owner = int(segments.owner[last])
            # What is spread along the rest of a segment that goes on is carried, too.
            goes_on = last + 1 < segments.parts[owner].elements.stop
            rest = 0.5 * (within[last, -1] + within[last + 1, 0]) if goes_on else 0.0
            found.append(pulls[owner] + rest)
        return rows, np.concatenate(found)

    @functools.cached_property
    def _strings(self) -> Array:
        """What strings between nodes of elements take over from these, as a pull, (elements, axes)."""
        return self._equations.strings(self.state, self._loading)

    @functools.cached_property
    def _ringed(self) -> Array:
        """What rings add to these at the starts of elements, as a pull, (elements, axes)."""
        return self._equations.strings(self.state, self._loading, along=True)

    @functools.cached_property
    def balance(self) -> Balance:
        """Reactions, and the forces of springs and small members."""
        return Balance(self._equations, self.state, self.loading, self._nodal)

    # -- nodes ----------------------------------------------------------------------------------

    def position(self, node: str) -> Array:
        """Position of a node, (3,) m."""
        moved = _three(self._nodal[self.model.nodes.index(node)]) * self.model.scales.length
        return np.asarray(self.model.scene.nodes[node].position, dtype=float) + moved

    def rotation(self, node: str) -> Array | None:
        """Quaternion (4,) or, in the plane, angle (1,) of a node since the undeformed scene; None if it has none."""
        number = self.model.rotations.node_turn[node]
        return None if number is None else self.q[number]

    def motion_of(self, contact: str) -> tuple[Array, Array] | None:
        """How an obstacle has moved since the undeformed scene: the matrix (3, 3) of its rotation, and the place (3,) m
        to which that would turn the origin; None where it stays.
        """
        return self._motions.get(contact)

    @functools.cached_property
    def _motions(self) -> dict[str, tuple[Array, Array]]:
        """As of :meth:`motion_of`, of obstacles that move."""
        found, space = dict[str, tuple[Array, Array]](), self.model.space
        for name, contact in self.model.scene.contacts.items():
            node = contact.node
            turn = None if node is None else self.rotation(node)
            if node is not None and turn is not None:
                turned = quaternion.matrix(turn if space else quaternion.from_rotation_vector([0.0, 0.0, turn[0]]))
                place = np.asarray(self.model.scene.nodes[node].position)
                found[name] = turned, self.position(node) - turned @ place
        return found

    def seen(self, contact: str, points: Array, tangents: Array) -> tuple[Array, Array]:
        """Points (n, 3), m, and vectors (n, 3) as an obstacle sees them that moves: as if it had not moved."""
        moved = self.motion_of(contact)
        return (points, tangents) if moved is None else ((points - moved[1]) @ moved[0], tangents @ moved[0])

    def obstacle(self, contact: str) -> Obstacle:
        """An obstacle where it is."""
        stop, moved = self.model.scene.obstacles[contact], self.motion_of(contact)
        return stop if moved is None else stop.moved(*moved)

    def reaction(self, node: str) -> tuple[Array, Array]:
        """Force (3,) N and moment about the node (3,) N m that the ground exerts on a supported node."""
        force, moment = self.balance.reaction(node)
        return force * self.model.scales.force, moment * self.model.scales.moment

    def spring(self, name: str) -> SpringState:
        """State of a spring, in SI units."""
        return self.balance.spring(name)

    def ring(self, name: str) -> dict[str, Any]:
        """Where a ring is, ``at`` as fraction of the length, its ``force`` (3,) N on the member, and where it is driven
        the force that moves it along the member, ``drive`` N.
        """
        model, found = self.model, self.balance.answers("rings", name)
        length = model.scene.center_lines[model.scene.rings[name].member].length
        at = model.scene.ring_places[name] + found.pop("moved") / length
        force = np.array([found.pop(f"force {axis}") for axis in "xyz"])
        return {"at": at, "force": force, **found}

    def contact_point(self, point: ContactPoint) -> dict[str, Any]:
        """Where members touch, ``at`` as fractions of their lengths, the ``force`` (3,) N on the first one, and its
        size ``push`` N, below zero where it would be a pull.

        With friction ``push`` is the size of the part across, ``friction`` (3,) N the part along, ``slip`` (3,) m how
        far the first one has slipped since the last state of the way, ``rubs`` N the size that the law of friction is
        for, ``sticks`` whether it sticks by more than little, and ``slides`` whether it has slid since then.
        """
        return self._touching[point.name]

    @functools.cached_property
    def contact_points(self) -> tuple[ContactPoint, ...]:
        """The points of contact of the mesh, where they are now."""
        points, told = self.model.mesh.points, self._touching
        return tuple(replace(p, at=told[p.name]["at"]) if any(p.slides) else p for p in points)

    @functools.cached_property
    def _touching(self) -> dict[str, dict[str, Any]]:
        """As of :meth:`contact_point`, by the names of points."""
        return {point.name: self._told(point) for point in self.model.mesh.points}

    def _told(self, point: ContactPoint) -> dict[str, Any]:
        """As of :meth:`contact_point`, of a point of the mesh."""
        found, lines = self.balance.answers("contacts", point.name), self.model.scene.center_lines
        moved = (found.get("moved on first", 0.0), found.get("moved on second", 0.0))
        at = tuple(float(a + s / lines[m].length) for a, s, m in zip(point.at, moved, point.members, strict=False))
        slip = np.array([found.get(f"slip {axis}", 0.0) for axis in "xyz"])
        if point.line:
            shares = self.balance.pressed[point.name]
            force, friction = shares.sum(axis=(0, 1, 2)), shares[1:].sum(axis=(0, 1, 2))
        else:
            force = np.array([found[f"force {axis}"] for axis in "xyz"])
            friction = np.array([found.get(f"friction {axis}", 0.0) for axis in "xyz"])
        answer: dict[str, Any] = {"at": at, "force": force, "push": found["push"]}
        if point.met:
            here = self.slopes(point.members[0], np.clip(at, 0.0, 1.0))
            answer["push"] = float(force @ self.obstacle(point.contact).normals(here, here, point.edge)[0])
        if point.grip is not None:
            # Along a line the friction that the law is for is that along the directions of each place.
            size = float(np.linalg.norm([found[f"friction {axis}"] for axis in "xyz"]))
            limit = point.grip.coefficient * found["push"]
            answer |= {"friction": friction, "slip": slip, "rubs": size, "sticks": bool(size < limit * (1.0 - SLIDES))}
            answer["slides"] = bool(found["beyond"] > 0.0)
        return answer

    @functools.cached_property
    def _spread(self) -> Array:
        """Forces along the elements, at their points (elements, points, axes): loads, and what presses along lines."""
        return self._loading.spread + self._pressing if self.model.mesh.lies else self._loading.spread

    @functools.cached_property
    def _pressing(self) -> Array:
        """What presses along lines, at the points of elements, (elements, points, axes)."""
        found, model = np.zeros_like(self._loading.spread), self.model
        for point in (point for point in model.mesh.points if point.line):
            beside = [element for element, *_ in beside_line(model.mesh, point)]
            forces = self.balance.pressed[point.name].sum(axis=0)[..., : model.element.axes] / model.scales.force
            found[model.beams.first[point.members[0]] + np.array(beside)] += forces
        return found

    def pressure(self, member: str, x: Array) -> Array:
        """Pressure (n, 3), N/m, of obstacles that a flexible member lies along, at fractions x (n,) of its length.

        It is linear along elements, at whose ends it may jump, and has the friction of rough obstacles.  What presses
        at single places is no part of it.
        """
        mesh, x = self.model.mesh, np.asarray(x, dtype=float)
        found, cuts, (points, weights) = np.zeros((len(x), 3)), mesh.cuts[member], mesh.rule
        if not mesh.lies:
            return found
        element = np.clip(np.searchsorted(cuts, x, side="right") - 1, 0, len(cuts) - 2)
        lengths = np.diff(cuts)
        forces = self._pressing[self.model.beams.first[member] + np.arange(len(lengths))] * self.model.scales.force
        forces /= weights[:, None] * (lengths * self.model.scene.center_lines[member].length)[:, None, None]
        for e in np.unique(element):
            here = element == e
            values = evaluation(points, (x[here] - cuts[e]) / lengths[e]) @ forces[e]
            found[here, : forces.shape[2]] = values
        return found

    @functools.cached_property
    def _pushed(self) -> dict[str, list[tuple[float, Array | None]]]:
        """Where rings, other members and obstacles push members, by member: fraction of the length, and within elements
        the force (3,) N.
        """
        found: dict[str, list[tuple[float, Array | None]]] = {}
        for name, ring in self.model.scene.rings.items():
            answer = self.ring(name)
            found.setdefault(ring.member, []).append((answer["at"], answer["force"]))
        for point in self.model.mesh.points:
            answer = self.contact_point(point)
            for side, (member, at) in enumerate(zip(point.members, answer["at"], strict=True)):
                # Where elements end it pushes a place between them: their forces jump there by themselves.
                force = (1.0 - 2.0 * side) * answer["force"] if standing(self.model.mesh, point, side) is None else None
                found.setdefault(member, []).append((at, force))
        return found

    @functools.cached_property
    def kinks(self) -> dict[str, list[float]]:
        """Fractions of the length at which rings and other members push members, by member, rising."""
        return {member: sorted(at for at, _ in pushes) for member, pushes in self._pushed.items()}

    def drive(self, name: str) -> dict[str, Any]:
        """What enforces a prescribed motion: ``moment`` (N m) of a rotation, ``force`` (N) of a displacement.

        At a driven joint these are numbers, on the second member about the axis or along the line of the joint.  At a
        support they are what the ground exerts: (3,), or a number about its axis where the rotation is a number.
        """
        motion = self.model.scene.motions[name]
        if motion.between is not None:
            return dict(self.balance.answers("motions", name))
        found: dict[str, Any] = {}
        force, moment = self.reaction(motion.node)
        if motion.rotation is not None:
            axis = np.asarray(self.model.scene.nodes[motion.node].turn_axis, dtype=float)
            number = single_number(motion, "moment")
            found["moment"] = float(moment @ axis / np.linalg.norm(axis)) if number else moment
        if motion.displacement is not None:
            found["force"] = force
        return found

    # -- members --------------------------------------------------------------------------------

    def along(self, member: str, x: Array, *, dimensionless: bool = False) -> dict[str, Array]:
        """Fields at fractions x (n,) of a member's length.

        Returns
        -------
        dict
            ``position`` (n, 3) m; ``rotation`` since the undeformed scene, a quaternion (n, 4) or in the plane an angle
            (n, 1); section ``force`` (n, 3) N and ``moment`` (n, 3) N m, fixed axes, that the part beyond the place
            exerts on the part before it; ``curvature`` (n, 3) 1/m about the section's axes b1 (twist), b2, b3;
            ``strain`` (n, 3) of a member that stretches or shears, along these axes.
            ``dimensionless``: of a flexible or rigid member, force and moment without units and no curvature.
        """
        model, x = self.model, np.asarray(x, dtype=float)
        record, line = model.scene.members[member], model.scene.center_lines[member]
        if record.type == "small":
            return self._along_body(member, x)
        result = self._along(member, x)
        if dimensionless:
            return result
        frames = self._frames(member, x, result["rotation"])
        result["force"] = result["force"] * model.scales.force
        result["moment"] = result["moment"] * model.scales.moment
        strain = np.einsum("nij,ni->nj", frames, result["moment"])
        if record.type == "rigid":
            return {**result, "curvature": line.curvatures(x)}
        section = model.scene.sections[str(record.section)]
        yields = section.stretches or section.shifted
        forces = np.einsum("nij,ni->nj", frames, result["force"]) if yields else result["force"]
        if section.shifted:
            arms = section.arms(x)
            strain = strain + np.einsum("nji,nj->ni", arms, forces)
        branches = self._branches(member, x)
        strain = strain - branches[0]
        if member in model.scene.tubed:
            strain = self._shared_with_tubes(member, x, strain)
        elif section.law is not None and section.law.remembers:
            # Moments are no function of curvatures: those of the elements themselves are told.
            strain = self._changes(member, x)
        elif section.law is not None:
            near, axes = self.near(member, x), self.changeable(member)
            acting = np.concatenate([strain, forces], axis=1)[:, : near.shape[1]]
            strain, along = np.split(curvature_by_moment(model.scene, member, x, acting, near, axes), [3], axis=1)
        elif section.coupled and model.space:
            strain = np.einsum("nij,nj->ni", section.compliance_matrix(x), strain)
        else:
            stiffness = section.stiffness(x)
            with np.errstate(invalid="ignore"):
                strain = np.where(np.isnan(stiffness), 0.0, strain / stiffness)
        result["curvature"] = line.curvatures(x) + self.natural(member, x) + strain
        if yields:
            result["strain"] = np.einsum("nij,nj->ni", section.compliance_of_forces(x), forces) - branches[1]
            form = form_of(model.scene, member)
            if section.stretch_law is not None:
                near = self._strains(member, x)[:, 0]
                result["strain"][:, 0] = strain_by_force(model.scene, member, x, forces[:, 0], near)
            elif form is not None and form.strains:
                own = self._strains(member, x) if form.remembers else along
                result["strain"][:, : form.strains] = own[:, : form.strains]
        if section.shifted:
            result["strain"] += np.einsum("nij,nj->ni", arms, strain)
        return result

    def _strains(self, member: str, x: Array) -> Array:
        """Strains along b1, b2, b3 (n, 3) as the points of the elements say at fractions x."""
        model, part = self.model, self.model.elements_of(member)
        cuts, weight = model.mesh.cuts[member], model.beams.weight[part]
        there = within_elements(cuts, model.element.points)
        section = model.scene.sections[str(model.scene.members[member].section)]
        axes = model.scene.center_lines[member].strained_axes(model.space)
        compliance = section.compliance(there.ravel())[:, axes].reshape(*there.shape, -1) * model.scales.force
        at, found = self._stations(member, x), np.zeros((len(x), 3))
        own = scaled_strains(model, self._placed.y)[part] * np.sqrt(compliance / weight[..., None])
        found[:, axes] = np.einsum("np,npa->na", at.at_points, own[at.elements])
        return found

    def _branches(self, member: str, x: Array) -> tuple[Array, Array]:
        """Moments (n, 3), N m, about b1, b2, b3 of what has not yet relaxed and of dampers, and strains (n, 3) by such
        forces.
        """
        model, dampers, part = self.model, self._loading.dampers, self.model.elements_of(member)
        parts = [carried(model, member, self.q, self._placed.y)]
        parts += [] if dampers is None else [(dampers.moment[part], dampers.strain[part])]
        found = [each for each in parts if each is not None]
        if not found:
            return np.zeros((len(x), 3)), np.zeros((len(x), 3))
        at, sums = self._stations(member, x), (sum(each[1:], each[0]) for each in zip(*found, strict=True))
        moment, strain = (np.einsum("np,npa->na", at.at_points, each[at.elements]) for each in sums)
        back = quaternion.conjugate(model.scene.center_lines[member].quaternions(x))
        return quaternion.rotate(back, moment) * model.scales.moment, strain

    def _shared_with_tubes(self, member: str, x: Array, moment: Array) -> Array:
        """Strains (n, 3), 1/m, about the section axes of a member that carries moments (n, 3), N m, with its tubes."""
        scene = self.model.scene
        more, offset = moments_of(self.model, member, x, self.twisted, self.bases)
        natural = scene.center_lines[member].curvatures(x) + self.natural(member, x)
        own = scene.sections[str(scene.members[member].section)].stiffness_matrix(x)
        missing = moment - offset - np.einsum("nij,nj->ni", more, natural)
        return np.asarray(np.linalg.solve(own + more, missing[..., None])[..., 0])

    @functools.cached_property
    def bases(self) -> dict[str, float]:
        """Angles of the bases of tubes, rad, by their names."""
        found = dict[str, float]()
        for group, load in zip(self.model.connections, self._loading.loads, strict=True):
            if group.kind.table == "tubes" and group.kind.along_element:
                found |= dict(zip(group.names, load[:, 0].tolist(), strict=True))
        return found

    def tube(self, name: str) -> dict[str, float]:
        """``torque`` (N m) that turns the base of a tube, ``angle`` (rad) of its front end against the section, and
        strain ``energy`` (J).
        """
        return self.balance.tube(name)

    def along_tube(self, name: str, at: Array) -> dict[str, Array]:
        """Turn, curvature and moment of a tube at fractions of its length, as of :meth:`.Configuration.along_tube`."""
        return fields_of_tube(self, name, at)

    def places_of_tube(self, name: str) -> Array:
        """Fractions (n,) of the length of a tube, rising from 0 to 1, at the nodes of elements."""
        return places_along(self.model, name)

    def section_forces(self, member: str, x: Array) -> Array:
        """Section forces (n, 3), N, along b1, b2, b3 at fractions x (n,) of a flexible or rigid member's length."""
        found = self._along(member, np.asarray(x, dtype=float))
        frames = self._frames(member, x, found["rotation"])
        return np.asarray(np.einsum("nij,ni->nj", frames, found["force"])) * self.model.scales.force

    def natural(self, member: str, x: Array) -> Array:
        """Natural twist and curvature (n, 3), 1/m, section axes, that actuations add at fractions x (n,) of a member's
        length.
        """
        model, part = self.model, self.model.elements_of(member)
        found = np.zeros((part.stop - part.start, len(model.element.points), 3))
        for group, load in zip(model.connections, self._loading.loads, strict=True):
            if group.kind.table == "actuations":
                number = group.elements - part.start
                own = (number >= 0) & (number < len(found))
                values = load[own].reshape(-1, found.shape[1], model.element.turns)
                found[number[own], :, 3 - model.element.turns :] = values
        if not found.any():
            return np.zeros((len(x), 3))
        at = self._stations(member, x)
        values = np.einsum("np,npa->na", at.at_points, found[at.elements]) / model.scales.length
        return quaternion.rotate(quaternion.conjugate(model.scene.center_lines[member].quaternions(x)), values)

    def bending(self, member: str, x: Array, curvature: Array) -> tuple[Array, Array]:
        """Largest fibre strain and stress (Pa) by bending, (n,) each, of a member whose section has a shape.

        The curvature that is natural strains no fibre; of what relaxes or is damped the stress is that of the moment.
        ``curvature`` (n, 3) 1/m at fractions x (n,) of the length, as of :meth:`along`.
        """
        scene = self.model.scene
        section = scene.sections[str(scene.members[member].section)]
        change = curvature - scene.center_lines[member].curvatures(x) - self.natural(member, x)
        fibres, largest = section.fibres(x), fibre_strain(section.shape != "rectangle")
        strain = largest(change.T, fibres[:, 1:].T).full().ravel()
        if not section.relaxation and self._loading.dampers is None:
            return strain, fibres[:, 0] * strain
        # As much as the long-term stiffness would bend under that moment.
        change = change + np.nan_to_num(self._branches(member, x)[0] / section.stiffness(x))
        return strain, fibres[:, 0] * largest(change.T, fibres[:, 1:].T).full().ravel()

    def largest_bending(self, member: str) -> tuple[float, float]:
        """Largest fibre strain and stress (Pa) by bending anywhere along a member whose section has a shape.

        It is taken from samples within the elements and from parabolas through three neighbouring samples.
        """
        cuts = self.model.mesh.cuts[member]
        x = np.append(within_elements(cuts, np.arange(PARTS) / PARTS).ravel(), cuts[-1])
        strain, stress = self.bending(member, x, self.along(member, x)["curvature"])
        return _largest(strain), _largest(stress)

    def strain_energy(self, member: str) -> float:
        """Strain energy of a flexible or small member, N m."""
        model = self.model
        if member in model.members:
            return float(self._strain_energies[model.elements_of(member)].sum()) * model.scales.moment
        return self.balance.answers("members", member)["energy"]

    @functools.cached_property
    def _strain_energies(self) -> Array:
        """Of all elements."""
        found = np.zeros(len(self.model.beams.weight))
        for number, group in enumerate(self.model.terms):
            if number and not group.kind.strains_member:
                continue
            load = self._loading.loads[number - 1] if number else None
            batch = GroupBatch(self.model, group, energies_of(group.kind))
            energies = batch(self.q, self._nodal, self._placed.unwrapped, load)[1].ravel()
            np.add.at(found, group.elements if number else np.arange(len(found)), energies)
        return found

    @functools.cached_property
    def dissipated(self) -> dict[str, float]:
        """What each member whose law has memory has dissipated since it was undeformed, J."""
        return dissipated_along(self.model, self.q, self._placed.y)

    @property
    def spent(self) -> float:
        """What the last step has dissipated, J."""
        before = (self.model.mesh.memory or {}).values()
        return sum(self.dissipated.values()) - sum(one.dissipated for one in before)

    @functools.cached_property
    def energies(self) -> tuple[float, float]:
        """Elastic energy, and potential of the loads since the undeformed scene, dimensionless."""
        point = self._equations.at(self.state, self.loading)
        return point.strain, point.potential - point.strain - self.spent / self.model.scales.moment

    def magnet(self, name: str) -> dict[str, Any]:
        """What the fields do to a magnet: ``energy`` (N m), ``torque`` (3,) N m and ``force`` (3,) N."""
        model, total = self.model, self._of_magnet(name).sum(axis=0)
        energy, torque = float(total[0] * model.scales.moment), total[1:4] * model.scales.moment
        return {"energy": energy, "torque": torque, "force": total[4:7] * model.scales.force}

    def _of_magnet(self, name: str) -> Array:
        """What each term of a magnet answers, (n, 8), dimensionless."""
        model, found = self.model, [np.zeros((0, 8))]
        loads = self._loading.before or self._loading.loads
        for number, own in magnet_terms(model.connections, name):
            group = model.connections[number]
            batch = GroupBatch(model, group, answers_of(group.kind))
            found.append(batch(self.q, self._nodal, self._placed.unwrapped, loads[number])[0][own])
        return np.concatenate(found)

    def placed(self, member: str, x: Array) -> tuple[Array, Array]:
        """``position`` and ``rotation`` of :meth:`along` without the rest."""
        if self.model.scene.members[member].type == "small":
            found = self._along_body(member, x)
            return found["position"], found["rotation"]
        return self.positions(member, x), rotations_along(self.model, self.q, member, x)

    def _along(self, member: str, x: Array) -> dict[str, Array]:
        """Position (m), rotation, force and moment, dimensionless."""
        return self._shared(member, x)[0]

    def taken(self, member: str, x: Array) -> Array:
        """Force (n, 3) that tendons along a member carry through its sections at fractions x, dimensionless."""
        return self._shared(member, x)[1]

    def _shared(self, member: str, x: Array) -> tuple[dict[str, Array], Array]:
        """As :meth:`_along`, and the force (n, 3) that tendons along the member carry beside the section."""
        model = self.model
        part = model.elements_of(member)
        at, pull = self._stations(member, x), self._pull[part]
        e, spread = at.elements, self._spread[part]
        position, moments = self.positions(member, x), self._element_moments(member)
        force = _three(np.einsum("nk,nka->na", at.spread, spread[e]) - pull[e, 0])
        # m' = -r' x n; the pull at the points is minus the force there.
        moment = _summed(at, moments, self._gained(part, pull))
        for element, place, push in self._pushes(member):
            beyond = (e == element) & (x > place)
            force[beyond] -= push
            arms = (position[beyond] - self.positions(member, np.array([place]))) / model.scales.length
            moment[beyond] -= np.cross(arms, -push)
        rotation, taken = rotations_along(model, self.q, member, x), np.zeros_like(force)
        if stretches_of(model.scene, member):
            about, taken = self._strung(member, x, rotation, moment)
            moment, force = moment - about, force - taken
        return {"position": position, "rotation": rotation, "force": force, "moment": moment}, taken

    def _pushes(self, member: str) -> list[tuple[int, float, Array]]:
        """What pushes a member: its element, counted from 0, fraction of the length, and force (3,), dimensionless."""
        found = list[tuple[int, float, Array]]()
        for at, force in self._pushed.get(member, ()):
            if force is None:
                continue
            # At an end of elements it is that before it, as the terms of rings have it.
            found.append((self.model.mesh.element_at(member, at), at, force / self.model.scales.force))
        return found

    def _strung(self, member: str, x: Array, rotation: Array, moment: Array) -> tuple[Array, Array]:
        """Moment and force (n, 3) that tendons along a member carry at its sections, dimensionless."""
        model, at, turns = self.model, self._stations(member, x), self.model.element.turns
        part = model.elements_of(member)
        tensions = np.column_stack(
            [self._tensions(name, piece, x) for name, piece in stretches_of(model.scene, member)]
        )
        nodal = self.q[model.rotations.turns[part]][at.elements]
        lengths = model.beams.weight[part].sum(axis=1)[at.elements]
        slope = np.einsum("nj,njc->nc", at.slopes, nodal) / lengths[:, None]
        guess, body = slope, moment[:, 2:]
        if model.space:
            guess = 2.0 * quaternion.multiply(quaternion.conjugate(rotation), slope)[:, 1:]
            body = quaternion.rotate(quaternion.conjugate(rotation), moment)
        # What is rigid is not bent.
        steps = NEWTON_STEPS if model.scene.members[member].type == "flexible" else 0
        function = share_of(model.space, tensions.shape[1], steps).map(len(x))
        data, frames = section_data(model, member, x, model.scales), model.scene.center_lines[member].quaternions(x)
        natural = quaternion.rotate(frames, self.natural(member, x))[:, -turns:] * model.scales.length
        strain = np.zeros((len(x), model.element.axes))
        if model.element.strains:
            gained = gained_tangents(model, self._placed)[part] / model.beams.weight[part][..., None]
            strain = np.einsum("np,npa->na", at.at_points, gained[at.elements])
        given = (body[:, -turns:], guess, natural, strain, data, tensions)
        found = function(*(part.T for part in given))
        about, along = (part.full().T for part in found)
        if model.space:
            return quaternion.rotate(rotation, about), quaternion.rotate(rotation, along)
        about = np.pad(about, ((0, 0), (2, 0)))
        return about, _three(quaternion.turned_by(rotation[:, None, :], along[:, None, :])[:, 0])

    def _tensions(self, name: str, piece: Stretch, x: Array) -> Array:
        """Tension (n,) of a tendon along a member at fractions x (n,) of it, dimensionless."""
        model, member, tendon = self.model, piece.member, self.model.scene.tendons[name]
        if not tendon.rubs:
            return np.full(len(x), self.balance.tendon(name)["tension"] / model.scales.force)
        number = model.scene.tendon_pieces[name].index(piece)
        if model.scene.members[member].type == "rigid":
            rate = float(values_of(tendon.friction)) * (-1.0 if self.released(name) else 1.0)
            turned = turned_since(model.scene.center_lines[member], tendon, piece, x)
            return np.asarray(self.balance.tensions(name, number)[0] * np.exp(-rate * turned))
        at, part, cuts = self._stations(member, x), model.elements_of(member), model.mesh.cuts[member]
        middle = 0.5 * (cuts[at.elements] + cuts[at.elements + 1])
        found = np.zeros((len(x), model.element.order + 1))
        for element in np.unique(at.elements[(middle > piece.start) & (middle < piece.end)]).tolist():
            found[at.elements == element] = self.balance.tensions(name, number, part.start + element)
        return np.asarray(np.einsum("np,np->n", at.at_points, found))

    def released(self, name: str) -> bool:
        """Whether a tendon that rubs is let out, so that its tension rises from the pulled end on."""
        return is_let_out(self.model.scene, self.model.mesh, name)

    def tendon(self, name: str) -> dict[str, Any]:
        """Tension, N, and length, m, of a tendon, and of one that does not push whether it is slack.

        Of one with friction also the tension at the end that is not pulled and tensions (pieces,) behind the pieces of
        its way, N, from the pulled end on, and whether it is let out.
        """
        found: dict[str, Any] = {**self.balance.tendon(name)}
        tendon = self.model.scene.tendons[name]
        if tendon.friction is not None:
            # Without any it is the same all along.
            tensions = found.pop("tensions", [found["tension"]] * len(self.model.scene.tendon_pieces[name]))
            found |= {"far_tension": tensions[-1], "tensions": tensions, "released": self.released(name)}
        if not tendon.measured or tendon.pushes:
            return found
        slack = (name, "slack") in self.model.mesh.stops
        if tendon.stiffness is not None:
            slack = self.balance.elongation(name) <= 0.0
        # That of a slack one is a multiplier that solving leaves to rounding.
        return {**found, "slack": slack} | ({"tension": 0.0} if slack else {})

    def beyond(self, name: str) -> float:
        """How much longer than its free length at this load factor a tendon of given length is, m."""
        tendon, rest = self.model.scene.tendons[name], self.balance.rest_length(name)
        pull = (tendon.pull or 0.0) if tendon.length is None else rest - tendon.length
        factor = self.loading.factor
        if tendon.history is not None:
            factor = self.model.scene.histories[tendon.history].factor(factor)
        return float(self.balance.tendon(name)["length"] - rest + factor * pull)

    @property
    def twisted(self) -> Array:
        """Angles (places,), rad, by which tubes are twisted, at their places."""
        return self._nodal[:, 0]

    @property
    def outer_force(self) -> Array:
        """Resultant of what acts from outside but for supports and obstacles, (3,) N: loads, weights, and the pulls of
        springs, tendons and fields.
        """
        return _three(self._equations.outer_force(self.state, self.loading)) * self.model.scales.force

    def stiffness(self, member: str, x: float) -> float:
        """Smallest bending stiffness of a member's section at a fraction of its length, dimensionless."""
        values = self.model.scene.sections[str(self.model.scene.members[member].section)].stiffness(np.array([x]))
        return float(np.nanmin(values[0, 1:])) / (self.model.scales.moment * self.model.scales.length)

    def bend(self, member: str, x: Array, found: dict[str, Array]) -> Array:
        """Derivative (n, 3) of the unit tangent by the arc length, 1/m, fixed axes, from :meth:`along`."""
        frames = self._frames(member, x, found["rotation"])
        return np.cross(np.einsum("nij,nj->ni", frames, found["curvature"]), frames[:, :, 0])

    def _tangents(self, member: str, x: Array, rotation: Array) -> Array:
        """Tangents (n, 3) at fractions of the length."""
        return quaternion.rotate(self._axes(member, x, rotation), curves.FORWARD)

    def tangents(self, member: str, x: Array) -> Array:
        """Unit tangents (n, 3) of the centre line, fixed axes, at fractions x (n,) of the length."""
        return self._tangents(member, x, rotations_along(self.model, self.q, member, x))

    def slopes(self, member: str, x: Array) -> Array:
        """Derivatives (n, 3) of :meth:`positions` by the undeformed arc length, fixed axes, at fractions x (n,).

        The tangents but for the error of the mesh, times the stretch, and inclined where a member is sheared.
        """
        model, at = self.model, self._stations(member, x)
        part = model.elements_of(member)
        gained = (self.turned[part] - model.beams.tangent[part]) / model.beams.weight[part][..., None]
        changed = _three(np.einsum("np,npa->na", at.at_points, gained[at.elements]))
        return np.asarray(model.scene.center_lines[member].tangents(x) + changed)

    def positions(self, member: str, x: Array) -> Array:
        """Positions (n, 3) at fractions of the length, m."""
        model = self.model
        part = model.elements_of(member)
        gained = self.turned[part] - model.beams.tangent[part]
        moved = _three(_summed(self._stations(member, x), self.element_starts(member), gained))
        return model.scene.center_lines[member].positions(x) + moved * model.scales.length

    def moved_within(self, elements: Index, xi: Array) -> Array:
        """Displacements (n, axes), dimensionless, at places xi (n,) of elements (n,), in them from 0 to 1."""
        at = Stations.within(self.model.element, elements, xi)
        return _summed(at, self._reached[0], self.turned - self.model.beams.tangent)

    @functools.cached_property
    def _reached(self) -> tuple[Array, Array]:
        """Displacements at the starts and the ends of all elements, each (elements, axes)."""
        model = self.model
        steps = (self.turned - model.beams.tangent).sum(axis=1)
        names, begins = list(model.beams.first), np.array(list(model.beams.first.values()), np.intp)
        counts = np.diff(np.append(begins, len(steps)))
        places = np.array([model.segments.place(model.segments.ends[name, 0]) for name in names], np.intp)
        starts, ends = np.empty_like(steps), np.empty_like(steps)
        for count in np.unique(counts).tolist():
            own = counts == count
            each, first = begins[own][:, None] + np.arange(count), self._nodal[places[own]][:, None]
            ends[each] = first + np.cumsum(steps[each], axis=1)
            starts[each] = np.concatenate([first, ends[each][:, :-1]], axis=1)
        return starts, ends

    def rates(self, member: str, x: Array, spin: Array, known: Array) -> tuple[Array, Array]:
        """Velocity and angular velocity (n, 3) at fractions x (n,) of a flexible or rigid member's length,
        dimensionless.

        Parameters
        ----------
        spin : angular velocities (rotations, turns)
        known : velocities of all places, (places, axes)
            Between places velocities follow from the angular velocities; a remaining difference is distributed
            linearly.
        """
        model, part = self.model, self.model.elements_of(member)
        turns, axes = model.rotations.turns[part], model.element.axes
        at = self._stations(member, x)
        e, rows = at.elements, at.nodal
        about = np.zeros((*turns.shape, 3))
        about[..., 3 - spin.shape[1] :] = spin[turns]
        gained = np.cross(about, _three(self.turned[part]))[..., :axes]
        if model.element.strains:
            strains = model.segments.strains[part]
            rates = np.where((strains >= 0)[..., None], known[strains], 0.0)
        else:
            rates = np.zeros((*turns.shape, 0))
        if model.element.shifted:
            rates = np.concatenate([rates, self._bending_rates(part, about)], axis=2)
        if model.element.yielding:
            gained += quaternion.turned_by(turned_points(model, self.q)[part], yielded(model, rates, part))
        parts, segments, cuts = model.segments.parts, model.segments, model.mesh.cuts[member]
        mine = [one for one in parts if one.member == member]
        ends = np.array([mine[0].elements.start, *(one.elements.stop for one in mine)]) - part.start
        there = known[[segments.place(name) for name in (mine[0].start, *(one.end for one in mine))]]
        starts = there[0] + np.concatenate([np.zeros((1, axes)), np.cumsum(gained.sum(axis=1), axis=0)])
        missed = (there - starts[ends]).T
        spread = np.stack([np.interp(x, cuts[ends], column) for column in missed], axis=-1)
        velocity = _three(_summed(at, starts, gained) + spread)
        if not model.space:
            return velocity, np.einsum("nj,nja->na", rows, about[e])
        # Of the interpolated quaternion, whatever its length: w = 2 q' conj(q) / q.q.
        nodal = self.q[turns]
        rate = 0.5 * quaternion.multiply(np.pad(about, ((0, 0), (0, 0), (1, 0))), nodal)
        here, change = (np.einsum("nj,njc->nc", rows, values[e]) for values in (nodal, rate))
        turned = 2.0 * quaternion.multiply(change, quaternion.conjugate(here))[:, 1:]
        return velocity, turned / np.einsum("nc,nc->n", here, here)[:, None]

    def _bending_rates(self, part: slice, about: Array) -> Array:
        """Rates of the curvature times length at the points of elements, (elements, points, turns), about the fixed
        axes of the undeformed scene, for angular velocities of the nodes (elements, nodes, 3).
        """
        model, element = self.model, self.model.element
        shape, slope = (f(element.nodes, element.points) for f in (evaluation, differentiation))
        if not model.space:
            return np.asarray(np.einsum("kj,eja->eka", slope, about[..., 2:]))
        nodal = self.q[model.rotations.turns[part]]
        rate = 0.5 * quaternion.multiply(np.pad(about, ((0, 0), (0, 0), (1, 0))), nodal)
        (q, dq), (s, ds) = ([np.einsum("kj,ejc->ekc", rows, part) for part in (nodal, rate)] for rows in (shape, slope))
        # Of 2 conj(q) q' / q.q.
        back, square = quaternion.conjugate(q), np.einsum("ekc,ekc->ek", q, q)[..., None]
        found = quaternion.multiply(quaternion.conjugate(dq), s) + quaternion.multiply(back, ds)
        found -= 2.0 * np.einsum("ekc,ekc->ek", q, dq)[..., None] / square * quaternion.multiply(back, s)
        return np.asarray((2.0 * found / square)[..., 1:])

    def _stations(self, member: str, x: Array) -> Stations:
        return Stations(self.model.element, self.model.mesh.cuts[member], x)

    def _changes(self, member: str, x: Array) -> Array:
        """Changes (n, 3) of twist and of the curvatures about b2 and b3, 1/m, as elements say at fractions x."""
        model, part = self.model, self.model.elements_of(member)
        at = self._stations(member, x)
        nodal, line = self.q[model.rotations.turns[part]][at.elements], model.scene.center_lines[member]
        lengths = model.beams.weight[part].sum(axis=1)[at.elements] * model.scales.length
        slope = np.einsum("nj,njc->nc", at.slopes, nodal) / lengths[:, None]
        if model.space:
            rotation = rotations_along(model, self.q, member, x)
            spin = 2.0 * quaternion.multiply(quaternion.conjugate(rotation), slope)[:, 1:]
        else:
            spin = np.pad(slope, ((0, 0), (2, 0)))
        return np.einsum("nij,ni->nj", quaternion.matrix(line.quaternions(x)), spin)

    def near(self, member: str, x: Array) -> Array:
        """Changes (n, 3) of twist and of the curvatures about b2 and b3, 1/m, of the elements at fractions x (n,), and
        behind them the strains on which the law of a member's section depends.
        """
        form, near = form_of(self.model.scene, member), self._changes(member, x)
        if form is None or not form.strains:
            return near
        return np.concatenate([near, self._strains(member, x)[:, : form.strains]], axis=1)

    def changeable(self, member: str) -> list[int]:
        """The numbers of the entries of :meth:`near` that the scene may change."""
        form, line, space = form_of(self.model.scene, member), self.model.scene.center_lines[member], self.model.space
        axes = [0, 1, 2] if space else [line.bending_axis - 1]
        count = 0 if form is None else form.strains
        return axes + [3 + i for i in line.strained_axes(space) if i < count]

    def _frames(self, member: str, x: Array, rotation: Array) -> Array:
        """Section axes as columns, (n, 3, 3)."""
        return quaternion.matrix(self._axes(member, x, rotation))

    def _axes(self, member: str, x: Array, rotation: Array) -> Array:
        """Quaternions (n, 4) of the section axes."""
        if not self.model.space:
            zero = np.zeros(len(x))
            vectors = np.stack([zero, zero, rotation[:, 0]], axis=-1)
            rotation = quaternion.from_rotation_vector(vectors)
        return quaternion.multiply(rotation, self.model.scene.center_lines[member].quaternions(x))

    def _along_body(self, member: str, x: Array) -> dict[str, Array]:
        """Fields of a small member: its ends, and between them the shape of a beam that carries no load, and section
        forces as if what acts between the ends were spread along the chord, across it linearly and along it evenly.
        """
        model = self.model
        line, ends = model.scene.center_lines[member], model.rotations.ends[member]
        numbers = [ends[0], ends[-1]]
        places = [model.segments.place(model.segments.ends[member, i]) for i in (0, len(ends) - 1)]
        moved = _three(self._nodal[places]) * model.scales.length
        turned = self.q[numbers]
        if not model.space:
            turned = quaternion.from_rotation_vector(np.pad(turned, ((0, 0), (2, 0))))
        signed = turned[1] * (1.0 if turned[0] @ turned[1] >= 0.0 else -1.0)
        # Rotations go linearly from end to end; the rigid motion with them is corrected to meet the second end.
        mixed = (1.0 - x)[:, None] * turned[0] + x[:, None] * signed
        mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
        mean = turned[0] + signed
        mean /= np.linalg.norm(mean)
        rest = line.positions(np.concatenate([[0.0], x, [1.0]]))
        rigid = rest[0] + moved[0] + quaternion.rotate(mean, rest - rest[0])
        miss = rest[-1] + moved[1] - rigid[-1]
        bent = x**2 * (3.0 - 2.0 * x)
        chord = quaternion.rotate(mean, line.tangents(x)) * line.length
        spins = [2.0 * quaternion.multiply(q, quaternion.conjugate(mean))[1:] for q in (turned[0], signed)]
        hermite = (x * (1.0 - x) ** 2)[:, None] * np.cross(spins[0], chord) - (x**2 * (1.0 - x))[:, None] * np.cross(
            spins[1], chord
        )
        position = rigid[1:-1] + bent[:, None] * miss + hermite
        wrenches, whole = self.balance.body_ends(member), np.array([rest[0] + moved[0], *position, rest[-1] + moved[1]])
        force, moment = _between(wrenches[0], wrenches[-1], whole / model.scales.length, x)
        rotation = mixed if model.space else ((1.0 - x) * self.q[ends[0], 0] + x * self.q[ends[-1], 0])[:, None]
        scaled = {"force": force * model.scales.force, "moment": moment * model.scales.moment}
        return {"position": position, "rotation": rotation, **scaled, "curvature": line.curvatures(x)}

    def _ends(self, member: str) -> tuple[Array, Array]:
        """Where the nodes of a small member were, and where they are, (n, 3) m."""
        model = self.model
        names = model.scene.members[member].nodes
        rest = np.array([model.scene.nodes[name].position for name in names], dtype=float)
        places = [model.segments.place(model.segments.ends[member, i]) for i in range(len(names))]
        return rest, rest + _three(self._nodal[places]) * model.scales.length

    @functools.cached_property
    def bent(self) -> dict[str, float]:
        """Deformation of each small member in its frame: largest nodal displacement over its size, or rotation, rad."""
        model, found = self.model, dict[str, float]()
        members = {name: member for name, member in model.scene.members.items() if member.type == "small"}
        for count in {len(member.nodes) for member in members.values()}:
            names = [name for name, member in members.items() if len(member.nodes) == count]
            rest, now = (np.array(places) for places in zip(*map(self._ends, names), strict=True))
            turned = self.q[[model.rotations.ends[name] for name in names]]
            if not model.space:
                # From the mean angle: quaternions of angles that differ by turns would not tell their mean.
                mean = quaternion.from_rotation_vector(_about_z(turned.mean(axis=1)))
                turned = quaternion.from_rotation_vector(_about_z(turned))
            else:
                turned = turned * np.where((turned * turned[:, :1]).sum(axis=2) < 0.0, -1.0, 1.0)[..., None]
                mean = turned.sum(axis=1)
                mean /= np.linalg.norm(mean, axis=1)[:, None]
            moved = now - now[:, :1] - quaternion.rotate(mean[:, None, :], rest - rest[:, :1])
            spins = 2.0 * quaternion.multiply(turned, quaternion.conjugate(mean)[:, None, :])[..., 1:]
            sizes = np.linalg.norm(rest - rest[:, :1], axis=2).max(axis=1)
            far = np.linalg.norm(moved, axis=2).max(axis=1) / sizes
            found |= dict(zip(names, np.maximum(far, np.linalg.norm(spins, axis=2).max(axis=1)).tolist(), strict=True))
        return {name: found[name] for name in members}

    def beyond_limits(self) -> SolveError | None:
        """Why a state is beyond what its scene describes; None where it is not.

        A small member is deformed so far that linear elasticity has no meaning, a magnet is where the table of a field
        ends, or a ring is beyond an end of its member.
        """
        found = (
            (Status.SLID, self._slid_off()),
            (Status.OUTSIDE, self._beyond_tables()),
            (Status.BENT, self._bent_far()),
        )
        return next((SolveError(status, message) for status, message in found if message), None)

    def _slid_off(self) -> str:
        """A sentence on a ring that is beyond an end of its member; else empty."""
        for name, ring in self.model.scene.rings.items():
            at = self.ring(name)["at"]
            if not -tolerances.CLOSED <= at <= 1.0 + tolerances.CLOSED:
                where = f"at the fraction {at:.6g} of the length of {ring.member!r}"
                return f"ring {name!r} would be {where}, accepted: 0 to 1"
        return ""

    def _beyond_tables(self) -> str:
        """A sentence on a magnet that is where the table of a field ends; else empty."""
        scene = self.model.scene
        tables = [name for name, field in scene.fields.items() if field.table is not None]
        for name in scene.magnets if tables else ():
            if self._of_magnet(name)[:, 7].max(initial=0.0) > tolerances.WRITTEN:
                which = enumerated([repr(table) for table in tables])
                return f"{name!r} is outside of the table of the field {which}, beyond which there is none"
        return ""

    def _bent_far(self) -> str:
        """A sentence on the small member deformed most, where its linear elasticity is meaningless; else empty."""
        superelements = self.bent
        worst = [*superelements, ""][first_of_largest(np.array([*superelements.values(), 0.0]))]
        if not superelements.get(worst, 0.0) > LARGE:
            return ""
        found = f"{worst!r} by {superelements[worst]:.2g} of its length or rad, accepted: up to {LARGE:g}"
        return f"{found}, and to be accurate a few percent; make it flexible"

    def pulled(self, member: str) -> float:
        """Axial force of a small member with two ends over its transverse stiffness times its length (``12 EI / L^2``).

        The geometric stiffness that linear elasticity leaves out is of this share of the transverse stiffness.
        """
        model, record = self.model, self.model.scene.members[member]
        if len(record.nodes) != 2:
            return 0.0
        rest, now = self._ends(member)
        length, chord = float(np.linalg.norm(rest[1] - rest[0])), now[1] - now[0]
        if record.stiffness is not None:
            across = np.asarray(record.stiffness)[7:9, 7:9]
            firm = length * float(np.linalg.eigvalsh(across)[0] if model.space else across[0, 0])
        else:
            bending = model.scene.sections[str(record.section)].stiffness(np.array([0.5]))[0, 1:]
            firm = 12.0 * float(np.nanmin(bending) if model.space else bending[1]) / length**2
        forces = np.array([force for force, _ in self.balance.body_ends(member)]) * model.scales.force
        return float(np.abs(forces @ chord).max() / np.linalg.norm(chord)) / firm

    def _gained(self, part: slice, pull: Array) -> Array:
        """What the moment gains at the points of elements (elements, points, 3): by forces, less couples along them."""
        torque, gained = self._loading.torque[part], _cross(self.turned[part], pull)
        if self._loading.dampers is not None:
            torque = torque - self._loading.dampers.torque[part]
        gained[..., 3 - torque.shape[2] :] -= torque
        return gained

    @kept(MEMBERS)
    def element_starts(self, member: str) -> Array:
        """Displacement at the start of each element of a member (and its end)."""
        starts, ends = (reached[self.model.elements_of(member)] for reached in self._reached)
        return np.concatenate([starts, ends[-1:]])

    @kept(MEMBERS)
    def _element_moments(self, member: str) -> Array:
        """Moment at the start of each element of a member (and its end)."""
        model = self.model
        part = model.elements_of(member)
        gains = self._gained(part, self._pull[part]).sum(axis=1)
        for element, place, push in self._pushes(member):
            cut = model.mesh.cuts[member][element + 1]
            arm = np.diff(self.positions(member, np.array([place, cut])), axis=0)[0] / model.scales.length
            gains[element] += np.cross(arm, push)
        chain = model.rotations.turns[part]
        gains[:-1] -= self.balance.jumps(part)[1:]
        # A couple at a cut is a jump of the moment.
        if model.scene.members[member].type == "rigid":
            gains[:-1] -= self._loading.jump[part][1:]
        else:
            gains[:-1] -= self._loading.moment[chain[1:, 0]]
            # Section axes that have inertia give moments to all nodes.
            gains -= self._loading.moment[chain[:, 1:-1]].sum(axis=1)
        moments = -self.balance.start_moment(member) + np.concatenate([np.zeros((1, 3)), np.cumsum(gains, axis=0)])
        strings = self._strings[part]
        if strings.any():
            # A string gives couples that no loading knows: the elements say what reaches them.
            moments[:-1] = -self.balance.starting_moments(part) - _cross(self.turned[part, 0], strings)
        return np.asarray(moments)


def _about_z(angles: Array) -> Array:
    """Rotation vectors (..., 3) about z by angles (..., 1)."""
    return np.concatenate([np.zeros((*angles.shape[:-1], 2)), angles], axis=-1)


def _summed(at: Stations, starts: Array, gained: Array) -> Array:
    """What begins at elements (elements, axes) and is gained at their points (elements, points, axes), at stations."""
    return np.asarray(starts[at.elements] + np.einsum("nk,nka->na", at.gained, gained[at.elements]))


PARTS = 16
"""Parts of an element between whose ends the largest strain is looked for."""


def _between(first: Sequence[Array], last: Sequence[Array], places: Array, x: Array) -> tuple[Array, Array]:
    """Section forces and moments (n, 3) at fractions x (n,) of a line between two ends, by what is exerted on these.

    Parameters
    ----------
    first, last : force (3,) and moment (3,) on the ends
    places : ndarray (n + 2, 3)
        Of the start, the stations, and the end.
    """
    chord, arms = places[-1] - places[0], places[1:-1] - places[0]
    total, square = -(first[0] + last[0]), max(float(chord @ chord), TINY)
    # What acts between is a + b x for the whole line; its first moment about the end by the balance of moments.
    left = first[1] + last[1] - np.cross(chord, first[0])
    beyond = 0.5 * (total @ chord) * chord / square + np.cross(left, chord) / square
    a = 6.0 * beyond - 2.0 * total
    b = 2.0 * (total - a)
    s = x[:, None]
    about = np.cross(arms, first[0]) + np.cross(chord, a * s**2 / 2.0 + b * s**3 / 6.0)
    return -first[0] - (a * s + b * s**2 / 2.0), about - first[1] + s * (left @ chord) * chord / square


def _largest(values: Array) -> float:
    """The largest of values at the ends of the parts of elements; at the ends of elements they may have kinks."""
    i = int(values.argmax())
    if i % PARTS == 0:
        return float(values[i])
    before, here, after = values[i - 1 : i + 2]
    bend = 2.0 * here - before - after
    return float(here + (after - before) ** 2 / (8.0 * bend)) if bend > 0.0 else float(here)


def _cross(a: Array, b: Array) -> Array:
    """Cross products of vectors in the plane or in space, (..., 3)."""
    return np.cross(_three(a), _three(b))


def rotations_along(model: Any, q: Array, member: str, x: Array) -> Array:
    """Rotations since the undeformed scene at fractions x (n,) of a member: quaternions (n, 4) or angles (n, 1)."""
    at = Stations(model.element, model.mesh.cuts[member], x)
    nodal = q[model.rotations.turns[model.elements_of(member)]]
    values = np.einsum("nj,njc->nc", at.nodal, nodal[at.elements])
    return values / np.linalg.norm(values, axis=-1, keepdims=True) if model.space else values


def strained_like(target: Any, y: Array, source: Any, values: Array) -> None:
    """Set the strains, angles of tubes and pulls of tendons among the unknowns ``y`` of one model to those of another.

    In place; ``values`` are the displacement unknowns of the other model, of the same members on another mesh.
    """
    angles_like(target, y, source, values)
    for name in target.scene.tendons:
        there, here = (pulled_place(model.scene, model.mesh, name) for model in (source, target))
        if here and here == there:
            one, other = (model.positions.retained[model.segments.place(here)] for model in (source, target))
            y[other] = values[one]
    if not (target.element.strains and source.element.strains):
        return
    for name, member in target.scene.members.items():
        if not member.stretches(target.scene.sections):
            continue
        part, cuts = target.elements_of(name), target.mesh.cuts[name]
        x = within_elements(cuts, target.element.points)
        at, own = Stations(source.element, source.mesh.cuts[name], x.ravel()), source.elements_of(name)
        # Scaled strains grow with the root of the length that a point stands for.
        there = scaled_strains(source, values)[own] / np.sqrt(source.beams.weight[own])[..., None]
        found = np.einsum("nk,nka->na", at.at_points, there[at.elements]).reshape(*x.shape, -1)
        found *= np.sqrt(target.beams.weight[part])[..., None]
        retained = target.positions.retained[target.segments.strains[part]]
        y[retained[retained >= 0]] = found[retained >= 0]


def transferred(source: Any, state: State, target: Any) -> State:
    """A state of one model interpolated onto another mesh of the same scene.

    Displacements and multipliers are transferred by their names; those that are new on the other mesh are zero.
    """
    q = np.zeros((len(target.rotations.kind), target.element.components))
    for name, ends in target.rotations.ends.items():
        q[list(ends)] = state.q[list(source.rotations.ends[name])]
    for name in target.members:
        q[target.chain(name)] = rotations_along(source, state.q, name, target.along(name))
    for name, number in target.rotations.node_turn.items():
        if number is not None and source.rotations.node_turn[name] is not None:
            q[number] = state.q[source.rotations.node_turn[name]]
    y = _by_name(source.positions.unknowns, state.y, target.positions.unknowns)
    strained_like(target, y, source, state.y)
    settle(target, q, y)
    relax(target, q, y)
    lam = _by_name(source.row_names, state.lam, target.row_names)
    return State(q, y, lam, _counted(source, state, target))


def _counted(source: Any, state: State, target: Any) -> Array:
    """The angles that count turns on another model; that of a stop is the one of its spring."""
    names, wanted = source.unwrapping.names, target.unwrapping.names
    if names == wanted:
        return state.unwrapped
    known = dict(zip(names, state.unwrapped.tolist(), strict=True))
    found = _by_name(names, state.unwrapped, wanted)
    for i, name in enumerate(wanted):
        if " stop of " in name:
            found[i] = known["springs." + name.partition(" stop of ")[2]]
    return found


def _by_name(names: tuple[str, ...], values: Array, wanted: tuple[str, ...]) -> Array:
    """Values by their names; names that repeat go in their order."""
    if names == wanted:
        return values.copy()
    known: dict[tuple[str, int], float] = {}
    count: dict[str, int] = {}
    for name, value in zip(names, values, strict=True):
        count[name] = count.get(name, 0) + 1
        known[name, count[name]] = float(value)
    count, found = {}, []
    for name in wanted:
        count[name] = count.get(name, 0) + 1
        found.append(known.get((name, count[name]), 0.0))
    return np.array(found)
