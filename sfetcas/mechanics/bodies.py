"""Small members as superelements: stiffness, constraints of inextensibility, and consistent loads.

From a section the stiffness is that of linear beam theory, inextensible and unshearable as the flexible members
are, of any shape and any variation along it.  With the first end clamped, a wrench at the second moves that by

    C = int B^T D^-1 B ds,      B the moment at s of a unit wrench at the end,

exactly up to quadrature; the stiffness is the inverse of C where it has one, and what C cannot move (the length
of a straight member) becomes constraint rows.

Loads along a member are a profile times a vector fixed in space.  What they do to a body in a frame is given by
their sum, their first moment, and consistent forces at its ends, with the opposite sign of the clamping forces.  These
are the transpose of the shape functions of the ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import tolerances
from ..description.matrices import rigid_motions
from ..description.scene import Scene
from ..description.sections import breaks
from ..errors import SceneError
from ..mathematics import quaternion
from ..mathematics.arrays import Array, depends, numbers, values_of
from ..mathematics.interpolation import gauss, integration
from ..mathematics.keeping import kept

__all__ = ["BodyData", "Lever", "body_of", "lever_along", "own_axes", "quadrature", "shapes_along"]

PANELS, POINTS, PANELS_A_RADIAN = 24, 6, 4.0
"""Quadrature along a member: exact for polynomials of degree 11 a panel; so many panels where anything varies along it,
and so many at least that none turns by more than a quarter of a radian."""


@dataclass(frozen=True, eq=False)
class Lever:
    """A load profile along a small member, in the fixed axes of the undeformed scene.

    Attributes
    ----------
    total : float
        Integral of the profile, m (kg where the profile is a mass per length).
    first : ndarray (3,)
        First moment about the first node, m2 (kg m).
    ends : ndarray (3, 6 n)
        For a unit vector along each axis the consistent forces and moments at the n nodes.
    """

    total: float
    first: Array
    ends: Array


@dataclass(frozen=True, eq=False)
class BodyData:
    """A small member in SI units and the fixed axes of the undeformed scene.

    Attributes
    ----------
    rest : ndarray (n, 3)
        Positions of the nodes relative to the first one, m.
    stiffness : ndarray (6 n, 6 n)
        Stiffness matrix in displacements and rotations of the nodes; N/m, N, N m.
    stiff : ndarray (rows, 6 n)
        Deformations that are constrained to zero, as unit rows, with rotations times the size of the body.
    weight : Lever or None
        Distribution of mass; None where none is given.
    mass : ndarray (6 n, 6 n) or None
        Condensed mass matrix; None without one.
    """

    rest: Array
    stiffness: Array
    stiff: Array
    weight: Lever | None
    mass: Array | None = None


@kept(64)
def body_of(scene: Scene, name: str) -> BodyData:
    """Stiffness, constraints and loads of a small member."""
    member = scene.members[name]
    places = numbers([scene.nodes[n].position for n in member.nodes])
    rest = places - places[0]
    if member.stiffness is None:
        return _from_section(scene, name, rest)
    turn = np.kron(np.eye(2 * len(rest)), own_axes(scene, name))

    def fixed(matrix: ArrayLike) -> Array:
        own = numbers(matrix)
        return numbers(turn @ (0.5 * (own + own.T)) @ turn.T)

    mass = None if member.mass is None else fixed(member.mass)
    weight = None if mass is None else _lever_of_mass(mass, rest)
    return BodyData(rest, fixed(member.stiffness), np.zeros((0, 6 * len(rest))), weight, mass)


def own_axes(scene: Scene, name: str) -> Array:
    """Section axes b1, b2, b3 of a member at its start as columns of a rotation matrix (3, 3)."""
    return numbers(quaternion.matrix(scene.center_lines[name].quaternions(np.array([0.0])))[0])


def _lever_of_mass(mass: Array, rest: Array) -> Lever:
    """Weight of a condensed mass: its work on rigid motions and on deformations."""
    along = rigid_motions(np.zeros_like(rest))[:, :3]
    ends = along.T @ mass
    about = ends @ rigid_motions(rest)[:, 3:]
    # Moving along i while turning about j takes the mass times the component of (j x centre) along i.
    first = 0.5 * numbers([about[2, 1] - about[1, 2], about[0, 2] - about[2, 0], about[1, 0] - about[0, 1]])
    return Lever(np.trace(ends @ along) / 3.0, -first, ends)


def quadrature(scene: Scene, name: str) -> tuple[Array, Array]:
    """Quadrature points (n,), as fractions of the length, and weights (n,) along a member, on panels without kinks."""
    edges, (x, w) = _edges(scene, name), gauss(POINTS)
    lengths = np.diff(edges)[:, None]
    return (edges[:-1, None] + x * lengths).ravel(), (w * lengths).ravel()


def _edges(scene: Scene, name: str) -> Array:
    """Ends of the panels: equal ones, and wherever the shape, the section or a load profile has a kink."""
    member, line = scene.members[name], scene.center_lines[name]
    spread = [load for load in scene.loads_along.get(name, ()) if load.type == "distributed"]
    profiles = [load.profile for load in spread if load.profile is not None]
    kinks, even = [*line.breaks, *(kink for profile in profiles for kink in breaks(profile, line.length))], not profiles
    kinks += [end for load in spread for end in load.part]
    if member.section is not None:
        section = scene.sections[member.section]
        kinks, even = [*kinks, *section.breaks], even and section.even
    panels = 1 if even and member.shape.type in ("straight", "arc", "helix") else PANELS
    panels = max(panels, math.ceil(PANELS_A_RADIAN * line.turning))
    return np.unique(np.concatenate([np.linspace(0.0, 1.0, panels + 1), np.array(kinks, dtype=float)]))


def _integrals(edges: Array, values: Array, x: Array) -> Array:
    """Integrals from 0 to places x of what is given at the points of the quadrature, (len(x), ...)."""
    points, w = gauss(POINTS)
    panels = values.reshape(len(edges) - 1, POINTS, *values.shape[1:])
    lengths = np.diff(edges)
    whole = np.einsum("k,ek...->e...", w, panels) * lengths.reshape(-1, *[1] * (values.ndim - 1))
    before = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(whole, axis=0)])
    e = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(lengths) - 1)
    rows = integration(points, (x - edges[e]) / lengths[e]) * lengths[e][:, None]
    return numbers(before[e] + np.einsum("nk,nk...->n...", rows, panels[e]))


def _moments_of_wrench(arm: Array) -> Array:
    """Moment at places of a unit wrench at the end, (n, 3, 6); ``arm`` from the places to the end."""
    return np.concatenate([_cross_all(arm), np.broadcast_to(np.eye(3), (len(arm), 3, 3))], axis=2)


def compliance_along(scene: Scene, name: str, x: Array) -> Array:
    """Compliance against bending and twist, 1/(N m2), in the fixed axes at fractions x, (n, 3, 3).

    It is zero about axes that have no stiffness in the scene.
    """
    member, line = scene.members[name], scene.center_lines[name]
    section, frames = scene.sections[str(member.section)], quaternion.matrix(line.quaternions(x))
    if section.coupled:
        return np.einsum("nij,njl,nkl->nik", frames, section.compliance_matrix(x), frames)
    values = section.stiffness(x)
    inverse = np.where(np.isnan(values), 0.0, 1.0 / values)
    return np.einsum("nij,nj,nkj->nik", frames, inverse, frames)


def _from_section(scene: Scene, name: str, rest: Array) -> BodyData:
    line = scene.center_lines[name]
    x, w = quadrature(scene, name)
    flexible = compliance_along(scene, name, x) * (w * line.length)[:, None, None]
    b = _moments_of_wrench(line.positions(np.array([1.0]))[0] - line.positions(x))
    compliance = np.einsum("nji,njk,nkl->il", b, flexible, b)
    at_end, still = _against(scene, name, compliance)
    # Deformations are those of the second end seen from the first: E takes all freedoms to them.
    to_end = _seen_from_first(rest[1])
    stiff = still @ to_end
    density = scene.sections[str(scene.members[name].section)]
    weight = None if density.missing(["rhoA"]) else lever_along(scene, name, density.mass(x), x, w)
    return BodyData(rest, to_end.T @ at_end @ to_end, stiff, weight)


def _against(scene: Scene, name: str, compliance: Array) -> tuple[Array, Array]:
    """Inverse (6, 6) of the compliance of the second end, and what that cannot do, (n, 6), both by six freedoms."""
    line = scene.center_lines[name]
    # Seen as energies: forces times the size, rotations as they are.
    size = float(np.abs(values_of(line.positions(np.array([1.0]))[0] - line.start)).max())
    unit = np.array([size, size, size, 1.0, 1.0, 1.0])
    # In the plane only its own three freedoms.
    own = np.arange(6) if scene.resolved_dimension == "space" else np.array([0, 1, 5])
    energies = (compliance / unit[:, None] / unit[None, :])[np.ix_(own, own)]
    values, vectors = np.linalg.eigh(values_of(energies))
    still = numbers(vectors[:, values <= tolerances.RANK * values[-1]].T)
    if line.turning == 0.0:
        # The length of what is straight, whatever rounding says.
        still = np.concatenate([line.tangents(np.array([0.0]))[0], np.zeros(3)])[None, own]
    elif len(still) and depends(energies):
        raise SceneError("found a member that is all but straight, accepted: one that is straight", ("members", name))
    shift = values[-1] * (still.T @ still)
    found = np.linalg.inv(energies + shift) - shift / values[-1] ** 2
    onto = np.eye(6)[:, own] / unit[:, None]
    return onto @ found @ onto.T, still @ onto.T


def _carried(arms: Array) -> Array:
    """Displacement and rotation of the ends of arms (n, 3) by those of their feet, (n, 6, 6)."""
    one, other = (np.broadcast_to(np.eye(6)[part], (len(arms), 3, 6)) for part in (slice(3), slice(3, 6)))
    return np.concatenate([np.concatenate([one[:, :, :3], -_cross_all(arms)], axis=2), other], axis=1)


def _seen_from_first(arm: Array) -> Array:
    """Displacement and rotation of the second end against what the first one carries, (6, 12)."""
    return np.hstack([-_carried(arm[None, :])[0], np.eye(6)])


def _cross_all(r: Array) -> Array:
    """Columns ``r x e_i``, (n, 3, 3)."""
    return numbers(np.cross(r[:, None, :], np.eye(3)[None, :, :]).transpose(0, 2, 1))


def shapes_along(scene: Scene, name: str, x: Array) -> Array:
    """Shape functions (n, 6, 12): displacement and rotation at fractions x by those of the two ends.

    With the first end clamped, a wrench at the second one moves a place as by Betti a force there moves the second end.
    Motions of the ends that are constrained to zero move no place.
    """
    line = scene.center_lines[name]
    places, end = line.positions(x), line.positions(np.array([1.0]))[0]
    start = line.positions(np.array([0.0]))[0]
    q, qw = quadrature(scene, name)
    here, edges = line.positions(q), _edges(scene, name)
    softness = compliance_along(scene, name, q) * line.length
    b = _moments_of_wrench(end - here)
    compliance = np.einsum("nji,njk,nkl,n->il", b, softness, b, qw)
    # A unit force at x bends what is before it by (r(x) - r(s)) x e_i; its work on that is linear in r(x).
    bent = np.einsum("nji,njk->nik", b, softness)
    by_moment, by_origin = _integrals(edges, bent, x), _integrals(edges, bent @ _cross_all(here), x)
    by_wrench = np.concatenate([by_moment @ _cross_all(places) - by_origin, by_moment], axis=2).transpose(0, 2, 1)
    shapes = by_wrench @ _against(scene, name, compliance)[0] @ _seen_from_first(end - start)
    return np.concatenate([shapes[:, :, :6] + _carried(places - start), shapes[:, :, 6:]], axis=2)


def lever_along(scene: Scene, name: str, profile: Array, x: Array, w: Array) -> Lever:
    """Consistent loads of a profile at fractions x with quadrature weights w along a member that has a section."""
    line = scene.center_lines[name]
    share = profile * w * line.length
    first = share @ (line.positions(x) - line.positions(np.array([0.0]))[0])
    # What forces do at the ends is what the ends do where they act.
    return Lever(share.sum(), first, np.einsum("n,nij->ij", share, shapes_along(scene, name, x)[:, :3]))
