"""Kinds of connections: what each forbids and allows, one row of the table a kind."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scenes import made, model_of

from sfetcas.description.matrices import rigid_motions
from sfetcas.mathematics import quaternion as quat
from sfetcas.mechanics import joints, terms
from sfetcas.mechanics.equations import Equations
from sfetcas.mechanics.positions import normals
from sfetcas.solvers.prepared import Prepared

AXIS = np.array([0.2, -1.0, 0.5]) / np.linalg.norm([0.2, -1.0, 0.5])
OTHER = np.cross(AXIS, [0.3, 0.2, 0.9]) / np.linalg.norm(np.cross(AXIS, [0.3, 0.2, 0.9]))
LINE = np.array([0.8, -0.6])
ANGLE, TRAVEL = 0.7, 0.3


def about(axis, angle):
    return quat.from_rotation_vector(angle * np.asarray(axis))


def spun(rng, *more):
    """A rotation in space, and the same turned further about axes that it carries."""
    first = about(rng.normal(size=3), 1.0)
    second = first
    for axis in more:
        second = quat.multiply(second, about(axis, rng.uniform(-2.0, 2.0)))
    return first, second


def hinged(rng):
    a, b = spun(rng, AXIS)
    return [a, b], [], [(None, quat.rotate(a, AXIS))]


def crossed(rng):
    a, b = spun(rng, AXIS, OTHER)
    return [a, b], [], [(None, quat.rotate(a, AXIS)), (None, quat.rotate(b, OTHER))]


def driven(rng):
    a, _ = spun(rng)
    across = quat.rotate(a, normals(AXIS))
    return [a, quat.multiply(a, about(AXIS, ANGLE))], [], [(None, across[0]), (None, across[1])]


def driven_plane(rng):
    a = rng.normal()
    return [np.array([a]), np.array([a + ANGLE])], [], []


def slid(rng):
    a, _ = spun(rng)
    along, u = quat.rotate(a, AXIS), rng.normal(size=3)
    return [a], [u, u + rng.normal() * along], [along]


def slid_plane(rng):
    a, u = rng.normal(size=1), rng.normal(size=2)
    along = np.array([[np.cos(a[0]), -np.sin(a[0])], [np.sin(a[0]), np.cos(a[0])]]) @ LINE
    return [a], [u, u + TRAVEL * along], [along]


def slid_by(rng):
    a, _ = spun(rng)
    u = rng.normal(size=3)
    return [a], [u, u + TRAVEL * quat.rotate(a, AXIS)], list(quat.rotate(a, normals(AXIS)))


def slid_by_plane(rng):
    q, u, (along,) = slid_plane(rng)
    return q, u, [np.array([-along[1], along[0]])]


def anywhere(kind):
    """A state of a kind without rows, not far from rest."""

    def state(rng):
        turns, places = kind.sizes[:2]
        q = [about(rng.normal(size=3), 0.5) if kind.space else rng.normal(size=1) for _ in range(turns)]
        return q, [0.3 * rng.normal(size=kind.axes) for _ in range(places)], []

    return state


def body_data(kind, rng=None):
    """Rest places, a stiffness that resists no rigid motion, and rows that see none."""
    rng = rng or np.random.default_rng(11)
    rest = np.vstack([np.zeros(3), rng.normal(size=(kind.nodes - 1, 3))])
    if not kind.space:
        rest[:, 2] = 0.0
    each = np.arange(6) if kind.space else np.array([0, 1, 5])
    chosen = (6 * np.arange(kind.nodes)[:, None] + each).ravel()
    rigid = rigid_motions(rest)[chosen][:, each]
    across = np.eye(len(chosen)) - rigid @ np.linalg.pinv(rigid)
    root = rng.normal(size=(len(chosen), len(chosen))) @ across
    full = root.T @ root
    stiff = rng.normal(size=(kind.stiff, len(chosen))) @ across
    upper = full.T[np.tril_indices(len(chosen))]
    return np.concatenate([rest[:, : kind.axes].ravel(), upper, stiff.T.ravel()])


@dataclass(frozen=True)
class Case:
    """A kind, its data, an admissible state with the freedoms there, and what its sides being swapped means.

    Freedoms are rotation vectors of the second side (None, w), or displacements of the second place.
    """

    kind: terms.Term
    data: np.ndarray
    state: Callable
    load: tuple = ()
    swapped: Callable = lambda data, load: (data, load, 1.0)


SPACE, PLANE = True, False
SPRING = np.array([*AXIS, 1.7, 0.2, 0.0])
CROSSED = np.array([*AXIS, *OTHER, 1.7, 0.2, 0.0])
CASES = {
    "hinge": Case(joints.Hinge(SPACE), normals(AXIS).ravel(), hinged, swapped=lambda d, p: (d, p, -1.0)),
    "universal": Case(
        joints.Universal(SPACE), np.concatenate([AXIS, OTHER]), crossed, swapped=lambda d, p: (np.roll(d, 3), p, 1.0)
    ),
    "driven turn": Case(joints.DrivenTurn(SPACE), AXIS, driven, (ANGLE,), lambda d, p: (d, -p, -1.0)),
    "driven turn, plane": Case(
        joints.DrivenTurn(PLANE), np.array([0, 0, 1.0]), driven_plane, (ANGLE,), lambda d, p: (d, -p, -1.0)
    ),
    "slide": Case(joints.Slide(SPACE), normals(AXIS).ravel(), slid, swapped=lambda d, p: (d, p, -1.0)),
    "slide, plane": Case(
        joints.Slide(PLANE), np.array([0.6, 0.8]), slid_plane, swapped=lambda d, p: (d, p, -1.0)
    ),
    "driven slide": Case(joints.DrivenSlide(SPACE), AXIS, slid_by, (TRAVEL,), lambda d, p: (d, -p, -1.0)),
    "driven slide, plane": Case(
        joints.DrivenSlide(PLANE), LINE, slid_by_plane, (TRAVEL,), lambda d, p: (d, -p, -1.0)
    ),
    "turn spring": Case(
        joints.TurnSpring(SPACE), SPRING, anywhere(joints.TurnSpring(SPACE)),
        swapped=lambda d, p: (d * [1, 1, 1, 1, -1, 1], p, 1.0),
    ),
    "turn spring of a universal joint": Case(
        joints.TurnSpring(SPACE, crossed=True), CROSSED, anywhere(joints.TurnSpring(SPACE, crossed=True))
    ),
    "turn spring, plane": Case(
        joints.TurnSpring(PLANE), np.array([0, 0, 1, 1.7, 0.2]), anywhere(joints.TurnSpring(PLANE)),
        swapped=lambda d, p: (d * [1, 1, 1, 1, -1], p, 1.0),
    ),
    "spring": Case(
        joints.Spring(SPACE), np.array([0.5, 0.9, -0.3, 2.0, 0.4]), anywhere(joints.Spring(SPACE)),
        swapped=lambda d, p: (d * [-1, -1, -1, 1, 1], p, 1.0),
    ),
    "spring, plane": Case(
        joints.Spring(PLANE), np.array([0.5, 0.9, 2.0, 0.4]), anywhere(joints.Spring(PLANE)),
        swapped=lambda d, p: (d * [-1, -1, 1, 1], p, 1.0),
    ),
    "spring without length": Case(
        joints.Spring(SPACE), np.array([0.0, 0.0, 0.0, 2.0, 0.0]), anywhere(joints.Spring(SPACE))
    ),
    "line spring": Case(
        joints.LineSpring(SPACE), np.array([*AXIS, 2.0, 0.1]), anywhere(joints.LineSpring(SPACE)),
        swapped=lambda d, p: (d * [-1, -1, -1, 1, 1], p, 1.0),
    ),
    "line spring, plane": Case(
        joints.LineSpring(PLANE), np.array([*LINE, 2.0, 0.1]), anywhere(joints.LineSpring(PLANE)),
        swapped=lambda d, p: (d * [-1, -1, 1, 1], p, 1.0),
    ),
}  # fmt: skip
BODIES = {
    f"body of {n}, {'space' if space else 'plane'}, {stiff} rows": joints.Body(space, n, stiff)
    for space in (True, False)
    for n, stiff in ((2, 0), (2, 1), (3, 2))
}
CASES |= {name: Case(kind, body_data(kind), anywhere(kind)) for name, kind in BODIES.items()}
each = pytest.mark.parametrize("name", CASES)
with_rows = pytest.mark.parametrize("name", [n for n, c in CASES.items() if c.kind.sizes[2] and n not in BODIES])


def numbers(case, rng):
    """Data, loads and multipliers."""
    load = np.array(case.load) if case.load else 0.3 * rng.normal(size=case.kind.sizes[4])
    return case.data, load, rng.normal(size=case.kind.sizes[2])


def columns(kind, q, u):
    """Rotations and places as columns."""
    return np.reshape(q, (-1, kind.components)).T, np.reshape(u, (-1, kind.axes)).T


def evaluated(kind, q, u, data, load, lam):
    """Energy, stored energy, rows, gradient, stiffness, rotation Jacobian as arrays."""
    result = terms.rotation_gradient(kind)(*columns(kind, q, u), data, load, lam)
    energy, stored, rows, gradient, stiffness, rotation_jacobian = (part.full() for part in result)
    return float(energy[0, 0]), float(stored[0, 0]), rows.ravel(), gradient.ravel(), stiffness, rotation_jacobian


def moved(kind, q, u, step):
    """Sides turned about the fixed axes and displaced."""
    turned = kind.turns * len(q)
    w, d = step[:turned].reshape(-1, kind.turns), step[turned:].reshape(-1, kind.axes)
    new = [quat.multiply(quat.from_rotation_vector(v), a) if kind.space else a + v for a, v in zip(q, w, strict=True)]
    return new, [a + b for a, b in zip(u, d, strict=True)]


def width(kind):
    return kind.turns * kind.sizes[0] + kind.axes * kind.sizes[1]


def backwards(kind):
    """Numbers of the unknowns with the sides in the opposite order."""
    turned = np.arange(kind.turns * kind.sizes[0]).reshape(-1, kind.turns)[::-1].ravel()
    placed = np.arange(kind.axes * kind.sizes[1]).reshape(-1, kind.axes)[::-1].ravel()
    return np.concatenate([turned, kind.turns * kind.sizes[0] + placed])


@with_rows
def test_rank_is_what_the_freedoms_leave(name):
    """Rows are independent, vanish at admissible states, and their number is that of relative motions not free."""
    case, kind = CASES[name], CASES[name].kind
    for seed in range(5):
        rng = np.random.default_rng(seed)
        q, u, freedoms = case.state(rng)
        *_, rows, _, _, rotation_jacobian = evaluated(kind, q, u, *numbers(case, rng))
        np.testing.assert_allclose(rows, 0.0, atol=1e-14)
        relative = kind.turns if len(q) == 2 else kind.axes
        values = np.linalg.svd(rotation_jacobian, compute_uv=False)
        # The rows are of the size of angles and lengths, none much smaller.
        assert values.min() > 0.3
        assert kind.sizes[2] == relative - len(freedoms)


@with_rows
def test_reactions_do_no_work_on_freedoms_and_rigid_motions(name):
    case, kind = CASES[name], CASES[name].kind
    for seed in range(5):
        rng = np.random.default_rng(seed)
        q, u, freedoms = case.state(rng)
        *_, rotation_jacobian = evaluated(kind, q, u, *numbers(case, rng))
        assert rotation_jacobian.shape == (kind.sizes[2], width(kind))
        turned = kind.turns * len(q)
        for freedom in freedoms:
            motion = np.zeros(width(kind))
            if isinstance(freedom, tuple):
                motion[kind.turns : turned] = freedom[1]
            else:
                motion[turned + kind.axes :] = freedom
            np.testing.assert_allclose(rotation_jacobian @ motion, 0.0, atol=2e-15 * 8)
        for w in np.eye(3) if kind.space else [np.array([0.0, 0.0, 1.0])]:
            turn = np.tile(w if kind.space else w[2:], len(q))
            carried = [np.cross(w, np.pad(v, (0, 3 - len(v))))[: kind.axes] for v in u]
            np.testing.assert_allclose(rotation_jacobian @ np.concatenate([turn, *carried]), 0.0, atol=2e-15 * 8)


@pytest.mark.parametrize("name", [n for n in CASES if n not in BODIES and "universal joint" not in n])
def test_swapped_sides_say_the_same(name):
    case, kind = CASES[name], CASES[name].kind
    rng = np.random.default_rng(2)
    q, u, _ = anywhere(kind)(rng)
    data, load, lam = numbers(case, rng)
    energy, _, rows, gradient, stiffness, _ = evaluated(kind, q, u, data, load, lam)
    other_data, other_load, sign = case.swapped(data, load)
    back = evaluated(kind, q[::-1], u[::-1], other_data, other_load, sign * lam)
    assert back[0] == pytest.approx(energy, abs=1e-15)
    np.testing.assert_allclose(back[2], sign * rows, atol=1e-15)
    order = backwards(kind)
    np.testing.assert_allclose(back[3], gradient[order], atol=1e-14)
    np.testing.assert_allclose(back[4], stiffness[np.ix_(order, order)], atol=1e-14)


def slope(function, kind, q, u, i, h=1e-3):
    """Derivative along unknown i by differences of fourth order."""
    step = np.zeros(width(kind))
    step[i] = h
    e = [function(*moved(kind, q, u, k * step)) for k in (-2, -1, 1, 2)]
    return (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h)


@each
def test_derivatives_of_the_lagrangian(name):
    """Gradient, rows' derivative and stiffness (its symmetric form) by differences, at a state out of balance."""
    case, kind = CASES[name], CASES[name].kind
    rng = np.random.default_rng(4)
    q, u, _ = anywhere(kind)(rng)
    data, load, lam = numbers(case, rng)
    _, _, _, gradient, stiffness, rotation_jacobian = evaluated(kind, q, u, data, load, lam)

    def lagrangian(q, u):
        energy, _, rows, *_ = evaluated(kind, q, u, data, load, lam)
        return energy + lam @ rows

    n, scale = width(kind), max(1.0, np.abs(stiffness).max())
    change = np.array([slope(lambda *s: evaluated(kind, *s, data, load, lam)[3], kind, q, u, i) for i in range(n)])
    for i in range(n):
        # h^4 = 1e-12 of the fifth derivative; rounding of the energy over h.
        assert gradient[i] == pytest.approx(slope(lagrangian, kind, q, u, i), abs=3e-11 * scale)
        there = slope(lambda *s: evaluated(kind, *s, data, load, lam)[2], kind, q, u, i)
        np.testing.assert_allclose(rotation_jacobian[:, i], there, atol=3e-11 * scale)
    np.testing.assert_allclose(stiffness, 0.5 * (change + change.T), atol=3e-11 * scale)


@each
def test_components_and_turning_are_one_function(name):
    """Derivatives by components of quaternions, along rotations, are those by rotation vectors."""
    case, kind = CASES[name], CASES[name].kind
    rng = np.random.default_rng(5)
    q, u, _ = anywhere(kind)(rng)
    data, load, lam = numbers(case, rng)
    energy, _, rows, gradient, _, rotation_jacobian = evaluated(kind, q, u, data, load, lam)
    sides = columns(kind, q, u)
    gradient_of, jacobian = (part.full() for part in terms.slopes_of(kind)(*sides, data, load))
    hessian = terms.curvatures_of(kind)(*sides, data, load, lam, 1.3).full()
    assert float(terms.energies_of(kind)(*sides, data, load)[0]) == pytest.approx(energy, rel=1e-14)
    np.testing.assert_allclose(terms.rows_of(kind)(*sides, data, load).full().ravel(), rows, rtol=1e-14)

    def components(q, u):
        return np.concatenate([*q, *u, np.zeros(0)])

    along = np.array([slope(components, kind, q, u, i) for i in range(width(kind))])
    np.testing.assert_allclose(along @ (gradient_of.ravel() + jacobian.T @ lam), gradient, atol=1e-10)
    np.testing.assert_allclose(jacobian @ along.T, rotation_jacobian, atol=1e-11)
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-13 * max(1.0, np.abs(hessian).max()))


@pytest.mark.parametrize("name", ["turn spring", "turn spring, plane", "spring", "spring, plane", *BODIES])
def test_energy_does_not_see_a_rigid_motion(name):
    case, kind = CASES[name], CASES[name].kind
    rng = np.random.default_rng(6)
    q, u, _ = anywhere(kind)(rng)
    load, lam = np.zeros(kind.sizes[4]), rng.normal(size=kind.sizes[2])
    energy, _, rows, *_ = evaluated(kind, q, u, case.data, load, lam)
    turn, shift = about(rng.normal(size=3), 2.0) if kind.space else rng.normal(size=1), rng.normal(size=kind.axes)
    matrix = quat.matrix(turn) if kind.space else quat.matrix(about([0, 0, 1], turn[0]))[:2, :2]
    rest = case.data[: kind.axes * kind.sizes[1]].reshape(-1, kind.axes) if isinstance(kind, joints.Body) else None
    if isinstance(kind, joints.Spring):
        rest = np.array([np.zeros(kind.axes), case.data[: kind.axes]])
    there = [matrix @ (r + v) + shift - r for r, v in zip(rest if rest is not None else [], u, strict=True)]
    turned = [quat.multiply(turn, a) if kind.space else turn + a for a in q]
    other, _, other_rows, *_ = evaluated(kind, turned, there, case.data, load, lam)
    # To rounding of the energy.
    assert other == pytest.approx(energy, rel=1e-13)
    np.testing.assert_allclose(other_rows, rows, atol=1e-14 * 10)


def strained(kind, data):
    """Energy of what is not at rest in the undeformed scene."""
    if isinstance(kind, joints.Spring):
        n = kind.axes
        return 0.5 * data[n] * (np.linalg.norm(data[:n]) - data[n + 1]) ** 2
    if isinstance(kind, joints.LineSpring | joints.TurnSpring):
        stiffness, rest = (
            data[kind.first : kind.first + 2] if isinstance(kind, joints.TurnSpring) else data[kind.axes :]
        )
        return 0.5 * stiffness * rest**2
    return 0.0


@pytest.mark.parametrize("name", [n for n in CASES if "driven" not in n])
def test_undeformed_scene_has_the_energy_of_what_is_strained_and_no_gap(name):
    case, kind = CASES[name], CASES[name].kind
    q = [np.array([1.0, 0, 0, 0]) if kind.space else np.zeros(1)] * kind.sizes[0]
    load = np.random.default_rng(0).normal(size=kind.sizes[4])
    found = evaluated(kind, q, [np.zeros(kind.axes)] * kind.sizes[1], case.data, load, np.zeros(kind.sizes[2]))
    assert found[0] == pytest.approx(strained(kind, case.data), rel=1e-14, abs=1e-15)
    assert found[1] == pytest.approx(strained(kind, case.data), rel=1e-14, abs=1e-15)
    np.testing.assert_allclose(found[2], 0.0, atol=1e-15)


@pytest.mark.parametrize("name", BODIES)
def test_body_does_not_see_the_order_of_its_nodes(name):
    """Nodes backwards, with rest places, matrix and rows in the same order: the same energy and moments."""
    case, kind = CASES[name], CASES[name].kind
    rng = np.random.default_rng(8)
    q, u, _ = anywhere(kind)(rng)
    n, axes, count = kind.freedoms, kind.axes, kind.nodes
    rest = case.data[: axes * count].reshape(count, axes)[::-1]
    full = np.zeros((n, n))
    full.T[np.tril_indices(n)] = case.data[axes * count :][: n * (n + 1) // 2]
    full = np.triu(full) + np.triu(full, 1).T
    stiff = case.data[axes * count + n * (n + 1) // 2 :].reshape(n, kind.stiff)
    order = np.arange(n).reshape(count, -1)[::-1].ravel()
    upper = full[np.ix_(order, order)].T[np.tril_indices(n)]
    data = np.concatenate([(rest - rest[0]).ravel(), upper, stiff[order].ravel()])
    load, lam = np.zeros(kind.sizes[4]), np.zeros(kind.stiff)
    one = evaluated(kind, q, u, case.data, load, lam)
    two = evaluated(kind, q[::-1], u[::-1], data, load, lam)
    assert two[0] == pytest.approx(one[0], rel=1e-13)
    if kind.stiff:
        # Rows see displacements from the first node, and no rigid motion: those from the last do as well.
        np.testing.assert_allclose(two[2], one[2], atol=1e-14 * 10)
    order = backwards(kind)
    np.testing.assert_allclose(two[3], one[3][order], rtol=0, atol=1e-13 * np.abs(one[3]).max())


def test_body_is_linear_elasticity_for_small_motions():
    """Half the quadratic form of displacements and rotations, up to the third power of them."""
    kind = joints.Body(True, 3, 0)
    data, rng = body_data(kind), np.random.default_rng(1)
    full = np.zeros((18, 18))
    full.T[np.tril_indices(18)] = data[9:]
    full = np.triu(full) + np.triu(full, 1).T
    direction = rng.normal(size=18)

    def gap(size):
        small = size * direction.reshape(3, 6)
        q = [quat.from_rotation_vector(row[3:]) for row in small]
        found = evaluated(kind, q, list(small[:, :3]), data, np.zeros(kind.sizes[4]), np.zeros(0))[0]
        return abs(found - 0.5 * small.ravel() @ full @ small.ravel())

    assert gap(1e-2) / gap(1e-3) == pytest.approx(1e3, rel=0.1)


def test_hinge_is_zero_about_its_axis_and_nowhere_else():
    kind, data = joints.Hinge(True), normals(AXIS).ravel()
    first, lam = about([0.3, 0.9, -0.4], 1.0), np.array([0.7, -1.2])

    def rows(a, b):
        return evaluated(kind, [a, b], [], data, np.zeros(0), lam)[2]

    for angle in (-2.0, 0.1, 3.0):
        np.testing.assert_allclose(rows(first, quat.multiply(first, about(AXIS, angle))), 0.0, atol=1e-15)
    off = quat.multiply(first, about(normals(AXIS)[0], 0.01))
    np.testing.assert_allclose(rows(first, off), [0.01, 0.0], atol=1e-6)  # twice the sine of half the angle
    turn = about([1.0, -0.3, 0.8], 1.0)
    np.testing.assert_allclose(rows(quat.multiply(turn, first), quat.multiply(turn, off)), rows(first, off), atol=1e-15)


@pytest.mark.parametrize("space", [True, False])
def test_turn_spring_counts_turns(space):
    """Moment and energy against the closed form; in space within two turns of the value it is counted near.

    In the plane an axis against z counts the other way round.
    """
    kind = joints.TurnSpring(space)
    axis, k, rest = (AXIS, 1.7, 0.2) if space else (np.array([0.0, 0.0, -1.0]), 1.7, 0.2)
    base = about([0.5, -0.2, 0.9], 1.0) if space else np.array([0.4])
    for angle in (-6.2, -3.5, -np.pi, -0.3, 0.0, 1.0, np.pi, 4.0, 6.2, 20.0, -30.0):
        second = quat.multiply(base, about(axis, angle)) if space else base - angle
        data = np.array([*axis, k, rest, *([angle + 6.0] if space else [])])
        found = evaluated(kind, [base, second], [], data, np.zeros(0), np.zeros(0))
        assert found[0] == pytest.approx(0.5 * k * (angle - rest) ** 2, abs=1e-12)
        along = quat.rotate(base, axis) if space else np.array([-1.0])
        moment = found[3].reshape(2, -1)
        np.testing.assert_allclose(moment[1], k * (angle - rest) * along, atol=1e-12)
        np.testing.assert_allclose(moment[0], -moment[1], atol=1e-12)


def test_springs_of_a_universal_joint_turn_about_its_axes():
    """The moment is the effort along the axis of the one side, and nothing normal to both axes is left to the joint.

    The angles are those of two turns one after the other, near any number of turns.
    """
    kind, k, rest = joints.TurnSpring(True, crossed=True), 1.7, 0.2
    base = about([0.5, -0.2, 0.9], 1.0)
    for first, second in ((0.4, -1.1), (-2.5, 2.8), (9.0, 0.3), (-20.0, -8.0)):
        turned = quat.multiply(quat.multiply(base, about(AXIS, first)), about(OTHER, second))
        one = evaluated(
            kind, [base, turned], [], np.array([*AXIS, *OTHER, k, rest, first + 3.0]), np.zeros(0), np.zeros(0)
        )
        # Seen from the other side the base turns the other way about its axis.
        two = evaluated(
            kind, [turned, base], [], np.array([*-OTHER, *AXIS, k, rest, second - 3.0]), np.zeros(0), np.zeros(0)
        )
        for found, angle, along in (
            (one, first, quat.rotate(base, AXIS)),
            (two, second, -quat.rotate(turned, OTHER)),
        ):
            assert found[0] == pytest.approx(0.5 * k * (angle - rest) ** 2, rel=1e-13, abs=1e-12)
            np.testing.assert_allclose(found[3][3:], k * (angle - rest) * along, atol=1e-12 * max(abs(angle), 1.0))


def test_drive_is_smooth_through_every_angle():
    """The row of a driven turn vanishes at the angle, not at half a turn from it, also beyond half a turn."""
    kind, a = joints.DrivenTurn(True), about([0.5, -0.2, 0.9], 1.0)
    for angle in (-6.0, -np.pi, 0.0, 3.0, np.pi, 6.0):
        for off in (0.0, 0.3, np.pi):
            b = quat.multiply(a, about(AXIS, angle + off))
            row = evaluated(kind, [a, b], [], AXIS, np.array([angle]), np.ones(1))[2]
            np.testing.assert_allclose(row, 2.0 * np.sin(0.5 * off), atol=1e-14)


def test_spring_without_length_has_no_kink_where_its_ends_meet():
    found = evaluated(joints.Spring(True), [], [np.zeros(3)] * 2, np.array([0, 0, 0, 2.0, 0]), np.zeros(0), np.zeros(0))
    np.testing.assert_array_equal(found[3], 0.0)
    block = 2.0 * np.eye(3)
    np.testing.assert_array_equal(found[4], np.block([[block, -block], [-block, block]]))


# -- in scenes ------------------------------------------------------------------------------------------

FREEDOMS = {"rigid": 0, "hinge": 1, "universal": 2, "ball": 3, "slider": 1, "cylindrical": 2}
PAIRS = [
    (joint, space)
    for joint in FREEDOMS
    for space in (True, False)
    if space or joint not in ("universal", "cylindrical")
]


def two_links(joint, space=True):
    """A clamped flexible and a rigid link with a force at its end, joined in one way."""
    return {
        "dimension": "space" if space else "plane",
        "sections": {"s": {"EI2": 1.0, "EI3": 1.3, "GJ": 0.8}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": [1, 0.2, 0]}
            | ({"axis": AXIS.tolist() if space else [0, 0, 1]} if joint in ("hinge", "universal") else {})
            | ({"axis2": OTHER.tolist()} if joint == "universal" else {})
            | ({"direction": [0.3, 1, 0.5] if space else [0.3, 1]} if joint in ("slider", "cylindrical") else {}),
            "C": {"position": [1.5, 0.9, 0.3 if space else 0]},
        },
        "members": {
            "first": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": 0.9}},
            "link": {"nodes": ["B", "C"], "type": "rigid", "release": [joint, "rigid"]},
        },
        "loads": {"f": {"type": "force", "node": "C", "value": [0.2, -0.4, 0.3 if space else 0]}},
    }


@pytest.mark.parametrize("assembly", ["closing", "nodal"])
@pytest.mark.parametrize(("joint", "space"), PAIRS)
def test_rank_in_a_scene_is_six_less_the_freedoms(joint, assembly, space):
    """Unknowns less the rank of all rows: those of the clamped beam with a rigid joint, and the freedoms."""
    free = FREEDOMS[joint] if space else {"rigid": 0}.get(joint, 1)

    def left(joint):
        equations = Equations(model_of(two_links(joint, space), 2, 2, assembly=assembly))
        loading, rng = equations.model.loading(0.0), np.random.default_rng(3)
        state = equations.start(loading)
        step = np.zeros(equations.total)
        step[: equations.unknowns] = 0.3 * rng.normal(size=equations.unknowns)
        state = equations.moved(state, step)
        point = equations.at(replace(state, lam=0 * state.lam), loading)
        matrix = np.zeros((equations.total, equations.total))
        matrix[equations.row, equations.column] = point.entries
        values = np.linalg.svd(matrix[equations.unknowns :, : equations.unknowns], compute_uv=False)
        assert len(values) == 0 or values.min() > 1e-3
        return equations.unknowns - len(values)

    assert left(joint) - left("rigid") == free


def two_links_held(joint, space=True):
    """The links with a second support, so that no freedom is left."""
    table = two_links(joint, space)
    table["nodes"]["C"] |= {"support": "clamped"}
    table["loads"] = {"f": {"type": "force", "member": "first", "at": 0.5, "value": [0.2, -0.7, 0.3 if space else 0]}}
    return table


@pytest.mark.parametrize(("joint", "space"), PAIRS[2:])
def test_joint_in_a_scene_carries_nothing_along_its_freedoms(joint, space):
    """What the link takes at the joint, from the answer: no moment about hinge axes, no force along slides."""
    table = two_links_held(joint, space)
    prepared = Prepared(model_of(table, 3, 5))
    from_rest = prepared.correct(prepared.equations.start(prepared.model.loading(0.0)), prepared.model.loading(0.0))
    state = from_rest.state
    for factor in np.linspace(0.1, 1.0, 10):
        found = prepared.correct(state, prepared.model.loading(factor), iterations=30)
        assert found.converged
        state = found.state
    fields = found.fields
    link, base = fields.along("link", np.array([0.0])), fields.along("first", np.array([1.0]))
    node = made(table).nodes["B"]

    def turned(at, vector):
        q = at["rotation"][0] if space else about([0, 0, 1], at["rotation"][0, 0])
        return quat.rotate(q, np.asarray(vector) / np.linalg.norm(vector))

    force, moment = link["force"][0], link["moment"][0]
    assert np.abs(force).max() > 1e-3
    if joint == "hinge":
        assert moment @ turned(link, node.axis) == pytest.approx(0.0, abs=1e-12)
    if joint == "universal":
        for side, axis in ((base, node.axis), (link, node.axis2)):
            assert moment @ turned(side, axis) == pytest.approx(0.0, abs=1e-12)
    if joint == "ball":
        np.testing.assert_allclose(moment, 0.0, atol=1e-12)
    if joint in ("slider", "cylindrical"):
        along = turned(base, node.direction)
        assert force @ along == pytest.approx(0.0, abs=1e-11)
        gap = link["position"][0] - base["position"][0]
        np.testing.assert_allclose(np.cross(gap, along), 0.0, atol=1e-12)
    if joint == "cylindrical":
        assert moment @ turned(base, node.direction) == pytest.approx(0.0, abs=1e-12)
    # What the beam takes at its end and the link at its start are one wrench about the node.
    if joint not in ("slider", "cylindrical"):
        np.testing.assert_allclose(base["force"][0], force, atol=1e-12)
        np.testing.assert_allclose(base["moment"][0], moment, atol=1e-11)
    else:
        lever = np.cross(link["position"][0] - base["position"][0], force)
        np.testing.assert_allclose(base["moment"][0], moment + lever, atol=1e-11)
