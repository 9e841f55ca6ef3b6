"""Inertia of small members: mass matrices of sections, and points with constant masses that have the same energy."""

import copy

import casadi as ca
import numpy as np
import pytest
from scenes import UNLIKE, arc_across, made, model_of, textbook

import sfetcas
from sfetcas import SceneError
from sfetcas.description.matrices import rigid_motions
from sfetcas.mathematics import quaternion as quat
from sfetcas.mechanics.bodies import body_of, own_axes, quadrature, shapes_along
from sfetcas.mechanics.body_masses import body_mass
from sfetcas.mechanics.body_points import points_of
from sfetcas.mechanics.connections import freedoms
from sfetcas.mechanics.masses import masses_of

END = np.array([0.8, 0.5, 0.3])
LENGTH = float(np.linalg.norm(END))
THICK = UNLIKE | {"rhoI": [0.02, 0.015, 0.005]}
TAPERED = THICK | {"rhoA": {"at": [0, 1], "value": [0.3, 0.9]}, "EI2": {"at": [0, 1], "value": [1, 5]}}
ROUNDING = 1e-11
"""Of the largest: compliances are inverted, which costs four of the sixteen digits."""


def mass_of(scene, name):
    """Mass matrix of a small member in the fixed axes of the undeformed scene, zero without mass."""
    found = body_mass(scene, name)
    return np.zeros((6 * len(scene.members[name].nodes),) * 2) if found is None else found.matrix


def body(**member):
    """A small member between A and B."""
    plane = not member.pop("space", True)
    end = [*END[:2], 0.0] if plane else END.tolist()
    more = member.pop("nodes", {})
    section = member.pop("section", None)
    table = {
        "dimension": "plane" if plane else "space",
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": end}, **more},
        "members": {"m": {"nodes": ["A", *more, "B"], "type": "small", **member}},
        "sections": {},
    }
    if section is not None:
        table["sections"]["s"], table["members"]["m"]["section"] = section, "s"
    return table


def springy(mass, rest):
    """A stiffness without meaning that resists no rigid motion, with a mass."""
    motions = rigid_motions(rest)
    q = np.linalg.qr(motions)[0]
    return {"stiffness": (np.eye(len(motions)) - q @ q.T).tolist(), "mass": mass.tolist()}


def condensed(mass, rest, space=True):
    """A small member of any number of nodes; ``mass`` and ``rest`` in fixed axes, the first and the last at A and B."""
    names = {f"N{i}": {"position": place.tolist()} for i, place in enumerate(rest[1:-1])}
    axes = own_axes(made(body(section=UNLIKE, space=space)), "m")
    turn = np.kron(np.eye(2 * len(rest)), axes)
    return body(nodes=names, space=space, **springy(turn.T @ mass @ turn, rest @ axes))


PLACES = np.array([[0, 0, 0], [0.1, 0.7, -0.4], END])
"""Of three nodes."""


FLAT = PLACES * [1, 1, 0]
CORNERS = np.array([[0, 0, 0], [0.1, 0.7, -0.4], [0.5, -0.2, 0.3], END])


def of_particles(rest=PLACES, count=40):
    """A mass matrix of particles that rigid motions of the nodes move rigidly, and anything else anyhow."""
    rng, motions = np.random.default_rng(5), rigid_motions(rest)
    inverse, mass = np.linalg.pinv(motions), np.zeros((6 * len(rest),) * 2)
    for place in rng.normal(size=(count, 3)):
        shape = rigid_motions(place[None, :])[:3] @ inverse
        shape = shape + 0.3 * rng.normal(size=shape.shape) @ (np.eye(len(mass)) - motions @ inverse)
        mass += rng.uniform(0.1, 0.5) * shape.T @ shape
    return mass


def lumps(masses, inertia=(0.0, 0.0, 0.0)):
    """The mass of particles at the nodes."""
    return np.diag(np.concatenate([[m, m, m, *inertia] for m in masses]))


BODIES = {
    "straight": body(section=UNLIKE),
    "thick": body(section=THICK),
    "tapered": body(section=TAPERED),
    "arc": body(section=THICK, shape=arc_across([0, 0, 0], END, 2.0, [0, 0.3, 1])),
    "straight, plane": body(section=UNLIKE, space=False),
    "arc, plane": body(section=THICK, shape={"type": "arc", "angle": 1.5}, space=False),
    "particles": condensed(of_particles(), PLACES),
    "two nodes": condensed(of_particles(PLACES[::2]), PLACES[::2]),
    "particles, plane": condensed(of_particles(FLAT), FLAT, space=False),
    "thick lumps": condensed(lumps((0.4, 1.1, 0.2), (0.02, 0.03, 0.04)), PLACES),
    "lumps": condensed(lumps((0.4, 1.1, 0.2, 0.6)), CORNERS),
}


class Points:
    """The points of a body as functions of its nodes, SI."""

    def __init__(self, table, length=0.7):
        self.scene = made(table)
        self.space = self.scene.resolved_dimension == "space"
        self.body, self.length = body_mass(self.scene, "m"), length
        self.rest = self.body.rest
        self.chosen = freedoms(len(self.rest), self.space)
        self.kind, self.data = points_of("m", self.body, self.space, length)
        turns, places, rows, data, _ = self.kind.sizes
        q, u = ca.SX.sym("q", self.kind.components, turns), ca.SX.sym("u", self.kind.axes, places)
        given = ca.SX.sym("data", data)
        sides = [ca.vertsplit(q[:, i]) for i in range(turns)], [ca.vertsplit(u[:, i]) for i in range(places)]
        found = ca.vertcat(*self.kind.residual(*sides, given, ca.SX(0, 1)))
        self.function = ca.Function("points", [q, u, given], [found])
        assert found.numel() == rows

    def possible(self, w):
        """Velocities that the body can have: those of its freedoms without what does not exist."""
        stiff = body_of(self.scene, "m").stiff
        kept = np.zeros(w.shape)
        kept[self.chosen] = w[self.chosen]
        return kept - np.linalg.pinv(stiff) @ stiff @ kept

    def at(self, turn, w, t=0.0, spin=(0, 0, 0)):
        """The points (points, axes) and the numbers: w from rest, all turned, then by t spins about the origin."""
        r = quat.matrix(quat.from_rotation_vector(np.asarray(turn, float)))
        r = quat.matrix(quat.from_rotation_vector(t * np.asarray(spin, float))) @ r
        w = w.reshape(-1, 6)
        places = (self.rest + w[:, :3]) @ r.T
        u = (places - self.rest)[:, : self.kind.axes] / self.length
        of_frame = (
            quat.from_rotation_vector(t * np.asarray(spin, float)),
            quat.from_rotation_vector(np.asarray(turn, float)),
        )
        q = [quat.product(quat.product(*of_frame), quat.from_rotation_vector(a)) for a in w[:, 3:]]
        if not self.space:
            q = [[(np.asarray(turn) + t * np.asarray(spin))[2] + a[5]] for a in w]
        found = np.array(self.function(np.array(q).T, u.T, self.data)).ravel()
        count = self.kind.axes * self.kind.points
        return self.length * found[:count].reshape(-1, self.kind.axes), self.length * found[count:]

    def velocity(self, turn, w, spin=(0, 0, 0), start=None, step=1e-5):
        """Rates of both at ``start`` for velocities w of the nodes seen from the frame."""
        start = np.zeros(w.shape) if start is None else start
        two = zip(*(self.at(turn, start + t * w, t, spin) for t in (step, -step)), strict=True)
        return [(a - b) / (2 * step) for a, b in two]

    def energy(self, rates):
        return 0.5 * self.body.mass * sum(float((rate**2).sum()) for rate in rates)


@pytest.fixture(params=BODIES)
def points(request):
    return Points(copy.deepcopy(BODIES[request.param]))


def large(points):
    """Rotation vectors: none, and a large one."""
    return np.zeros(3), np.array([0.7, -1.4, 2.1]) * (1.0 if points.space else np.array([0, 0, 1.0]))


# -- energy and momentum ------------------------------------------------------------------------------------


def test_energy_is_that_of_the_mass_matrix(points):
    """At rest and at a large rotation of all, of any velocities."""
    rng, matrix = np.random.default_rng(1), mass_of(points.scene, "m")
    for w in rng.normal(size=(5, len(matrix))):
        w = points.possible(w)
        wanted = 0.5 * w @ matrix @ w
        for turn in large(points):
            # Central differences over 1e-5 leave 1e-10, of this size.
            assert points.energy(points.velocity(turn, w)) == pytest.approx(wanted, rel=1e-8)


def test_spin_beside_the_freedoms(points):
    """A rotation of all about the first node is one of the freedoms too, at a large rotation as at rest."""
    spin = np.array([0.3, -0.8, 0.5]) * (1.0 if points.space else np.array([0, 0, 1.0]))
    w, turn = points.possible(np.random.default_rng(2).normal(size=6 * len(points.rest))), large(points)[1]
    seen = quat.matrix(quat.from_rotation_vector(turn)).T @ spin
    both = w + rigid_motions(points.rest)[:, 3:] @ seen
    found = points.energy(points.velocity(turn, w, spin))
    assert found == pytest.approx(0.5 * both @ mass_of(points.scene, "m") @ both, rel=1e-8)


def test_only_the_centre_has_momentum(points):
    """Also of a deformed body; and the momentum at rest is that of the mass matrix."""
    n, rng = points.kind.axes, np.random.default_rng(3)
    w = points.possible(0.1 * rng.normal(size=6 * len(points.rest)))
    ahead = np.zeros(w.shape).reshape(-1, 6)
    ahead[:, :n] = step = rng.normal(size=n)
    (after, same), (before, numbers) = points.at(np.zeros(3), w + ahead.ravel()), points.at(np.zeros(3), w)
    moved = after - before
    np.testing.assert_allclose(same, numbers, atol=1e-14)
    np.testing.assert_allclose(moved[0], step, atol=1e-14)
    np.testing.assert_allclose(moved[1:], 0.0, atol=1e-14)
    momentum = rigid_motions(points.rest)[:, :n].T @ mass_of(points.scene, "m") @ w
    velocity, _ = points.velocity(np.zeros(3), w)
    np.testing.assert_allclose(points.body.mass * velocity[0], momentum, atol=1e-9 * np.abs(momentum).max())


def test_points_turn_with_all(points):
    """A deformed body turned: what its points are is turned, the first one from where the first node was."""
    w = points.possible(0.1 * np.random.default_rng(4).normal(size=6 * len(points.rest)))
    turn = large(points)[1]
    r = quat.matrix(quat.from_rotation_vector(turn))[: points.kind.axes, : points.kind.axes]
    (after, same), (before, numbers) = points.at(turn, w), points.at(np.zeros(3), w)
    np.testing.assert_allclose(after, before @ r.T, atol=1e-14)
    np.testing.assert_allclose(same, numbers, atol=1e-14)


def test_points_are_as_few_as_they_can_be():
    """A straight beam: its centre, its axis, two cubics in each plane; lumps: as many as they are, and nothing else."""
    counts = {name: (kind.points, kind.numbers) for name in BODIES for kind in [Points(BODIES[name]).kind]}
    assert counts["straight"] == (2, 4)
    assert counts["straight, plane"] == (2, 2)
    assert counts["lumps"] == (4, 0)
    found = Points(condensed(lumps((0.4, 1.1, 0.2)), PLACES)).kind
    assert (found.points, found.numbers) == (3, 0)


# -- centrifugal forces ---------------------------------------------------------------------------------------


def spread_out(places, masses, moved, spin):
    """Derivative of the energy of turning particles by their displacements (n, 3)."""
    return np.einsum("n,na,na->", masses, np.cross(spin, places), np.cross(spin, moved))


def centrifugal(points, spin, w):
    """The same of the points, along a possible deformation w that leaves the frame where it is."""
    h = 1e-4
    still = np.zeros(w.shape)
    a, b = (points.energy(points.velocity(np.zeros(3), still, spin, s * w)) for s in (h, -h))
    return (a - b) / (2 * h)


def deformation(points, rng):
    """A possible deformation without mean rotation."""
    w = points.possible(rng.normal(size=6 * len(points.rest))).reshape(-1, 6)
    mean = w[:, 3:].mean(axis=0)
    w[:, :3] -= np.cross(mean, points.rest)
    w[:, 3:] -= mean
    return w.ravel()


SECTIONS = ["straight", "thick", "tapered", "arc", "straight, plane", "arc, plane"]


@pytest.mark.parametrize("name", [*SECTIONS, "lumps"])
def test_centrifugal_forces_are_those_of_the_particles(name):
    """Along members with a section by quadrature over their shapes; of lumps at their nodes."""
    points, rng = Points(copy.deepcopy(BODIES[name])), np.random.default_rng(6)
    spin = rng.normal(size=3) if points.space else np.array([0, 0, 1.3])
    w = deformation(points, rng)
    if name == "lumps":
        masses = np.array(points.scene.members["m"].mass).diagonal()[::6]
        wanted = spread_out(points.rest, masses, w.reshape(-1, 6)[:, :3], spin)
    else:
        scene = points.scene
        x, weights = quadrature(scene, "m")
        section, line = scene.sections["s"], scene.center_lines["m"]
        shapes = shapes_along(scene, "m", x) @ w
        masses = section.mass(x) * weights * line.length
        wanted = spread_out(line.positions(x), masses, shapes[:, :3], spin)
        frames = quat.matrix(line.quaternions(x))
        inertia = (
            np.einsum("nai,ni,nbi->nab", frames, section.inertia(x), frames) * (weights * line.length)[:, None, None]
        )
        # Inertia turned by a is (a x) J - J (a x): what it gives is spin.(a x J spin).
        wanted += np.einsum("nk,nk->", np.cross(shapes[:, 3:], inertia @ spin), np.tile(spin, (len(x), 1)))
    assert abs(wanted) > 1e-2
    # Central differences of quadratic and cubic terms of size one.
    assert centrifugal(points, spin, w) == pytest.approx(wanted, abs=1e-6)


def test_a_turning_bar_is_stretched():
    """Two lumps at a distance l turn: the centrifugal force of each is m omega^2 l / 2."""
    points = Points(condensed(lumps((0.6, 0.6)), PLACES[::2]))
    along = END / LENGTH
    w = np.concatenate([np.zeros(6), along, np.zeros(3)])
    spin = 2.0 * np.cross(along, [0, 0, 1]) / np.linalg.norm(np.cross(along, [0, 0, 1]))
    # The first node stays at the axis: the second has m omega^2 l.
    assert centrifugal(points, spin, w) == pytest.approx(0.6 * 4.0 * LENGTH, rel=1e-6)


# -- mass of a section ----------------------------------------------------------------------------------------


def textbook_mass(length, rho):
    """Consistent mass of a straight beam in its own axes, without axial parts and torsion."""
    m, n = np.zeros((12, 12)), length
    c = np.array([[156, 22 * n, 54, -13 * n], [22 * n, 4 * n**2, 13 * n, -3 * n**2],
                  [54, 13 * n, 156, -22 * n], [-13 * n, -3 * n**2, -22 * n, 4 * n**2]]) * rho * n / 420  # fmt: skip
    for place, turn, sign in ((1, 5, 1.0), (2, 4, -1.0)):
        s = np.diag([1, sign, 1, sign])
        index = [place, turn, place + 6, turn + 6]
        m[np.ix_(index, index)] = s @ c @ s
    return m


def textbook_rotary(length, inertia):
    """Rotary inertia of the same beam (j1, j2, j3 per length)."""
    m, n = np.zeros((12, 12)), length
    m[np.ix_([3, 9], [3, 9])] = inertia[0] * n / 6 * np.array([[2, 1], [1, 2]])
    c = np.array([[36, 3 * n, -36, 3 * n], [3 * n, 4 * n**2, -3 * n, -(n**2)],
                  [-36, -3 * n, 36, -3 * n], [3 * n, -(n**2), -3 * n, 4 * n**2]]) / (30 * n)  # fmt: skip
    for j, place, turn, sign in ((inertia[2], 1, 5, 1.0), (inertia[1], 2, 4, -1.0)):
        s = np.diag([1, sign, 1, sign])
        index = [place, turn, place + 6, turn + 6]
        m[np.ix_(index, index)] += j * (s @ c @ s)
    return m


def test_straight_beam_has_the_textbook_mass():
    """Across and about the beam that of cubics; along it, where it cannot stretch, it moves as one."""
    scene = made(BODIES["thick"])
    turn = np.kron(np.eye(4), own_axes(scene, "m"))
    found = turn.T @ mass_of(scene, "m") @ turn
    wanted = textbook_mass(LENGTH, THICK["rhoA"]) + textbook_rotary(LENGTH, THICK["rhoI"])
    wanted[np.ix_([0, 6], [0, 6])] = 0.25 * THICK["rhoA"] * LENGTH
    np.testing.assert_allclose(found, wanted, atol=ROUNDING * np.abs(wanted).max())


def chain(scene, count):
    """The mass of many straight textbook beams along a member, with its interior where statics puts it."""
    line, s = scene.center_lines["m"], scene.sections["s"]
    x = np.linspace(0, 1, count + 1)
    places, middles = line.positions(x), 0.5 * (x[1:] + x[:-1])
    k, m = (np.zeros((6 * (count + 1),) * 2) for _ in range(2))
    for i, (q, stiffness) in enumerate(zip(line.quaternions(middles), s.stiffness(middles), strict=True)):
        n, frame = float(np.linalg.norm(places[i + 1] - places[i])), quat.matrix(q)
        turn = np.kron(np.eye(4), frame)
        part = slice(6 * i, 6 * i + 12)
        gj, ei2, ei3 = stiffness
        k[part, part] += turn @ textbook(n, 1e6, gj, ei2, ei3) @ turn.T
        own = textbook_mass(n, THICK["rhoA"]) + textbook_rotary(n, THICK["rhoI"])
        own[np.ix_([0, 6], [0, 6])] = THICK["rhoA"] * n / 6 * np.array([[2, 1], [1, 2]])
        m[part, part] += turn @ own @ turn.T
    inner, ends = np.arange(6, 6 * count), np.r_[0:6, 6 * count : 6 * count + 6]
    follow = np.zeros((6 * (count + 1), 12))
    follow[ends], follow[inner] = np.eye(12), -np.linalg.solve(k[np.ix_(inner, inner)], k[np.ix_(inner, ends)])
    return follow.T @ m @ follow


def test_mass_of_an_arc_is_that_of_many_straight_beams():
    """A route without the integrals of the compliance: the error falls with the square of the length of the beams."""
    points = Points(BODIES["arc"])
    kept = np.array([points.possible(w) for w in np.eye(12)]).T
    found = kept.T @ mass_of(points.scene, "m") @ kept
    errors = [np.abs(kept.T @ chain(points.scene, n) @ kept - found).max() for n in (12, 24)]
    assert errors[0] < 1e-2 * np.abs(found).max()
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("name", BODIES)
def test_mass_is_that_of_the_weight(name):
    scene = made(BODIES[name])
    body, weight = body_mass(scene, "m"), body_of(scene, "m").weight
    assert body.mass == pytest.approx(weight.total, rel=1e-12)
    np.testing.assert_allclose(body.mass * body.centre, weight.first, atol=1e-12)
    modes = rigid_motions(body.rest)[:, :3]
    np.testing.assert_allclose(modes.T @ body.matrix @ modes, weight.total * np.eye(3), atol=1e-11)


# -- whole models ---------------------------------------------------------------------------------------------


def turning_energy(model, spin):
    """Energy of all masses of a model that turns about the origin, SI."""
    masses, length = masses_of(model), model.scales.length
    n, energy = model.element.axes, 0.0
    spots = [segment_place(model, place) for place in model.segments.places]
    moving = np.cross(spin, np.array(spots)) / length
    energy += 0.5 * np.einsum("i,ia,ia->", masses.places.value, moving[masses.places.row], moving[masses.places.column])
    for name in model.members:
        if model.scene.members[name].type != "flexible":
            continue
        cuts, part = model.mesh.cuts[name], model.elements_of(name)
        x = cuts[:-1, None] + np.diff(cuts)[:, None] * model.element.nodes
        inner = model.scene.center_lines[name].positions(x.ravel())
        energy += 0.5 * masses.inner[part].ravel() @ (np.cross(spin, inner / length) ** 2).sum(axis=1)
    for group in masses.observables:
        turns, places, _, data, _ = group.kind.sizes
        q, u = ca.SX.sym("q", group.kind.components, turns), ca.SX.sym("u", n, places)
        given = ca.SX.sym("data", data)
        sides = [ca.vertsplit(q[:, i]) for i in range(turns)], [ca.vertsplit(u[:, i]) for i in range(places)]
        f = ca.Function("f", [q, u, given], [ca.vertcat(*group.kind.residual(*sides, given, ca.SX(0, 1)))])
        for sides_at, numbers, mass in zip(group.places, group.data, group.mass, strict=True):
            at = np.array([spots[i] for i in sides_at]).reshape(-1, 3) / length
            values = []
            for t in (1e-5, -1e-5):
                r = quat.from_rotation_vector(t * spin)
                u_now = (at @ quat.matrix(r).T - at)[:, :n].T
                q_now = np.tile(r, (turns, 1)).T if model.space else np.full((1, turns), t * spin[2])
                values.append(np.array(f(q_now, u_now, numbers)).ravel())
            energy += 0.5 * mass @ ((values[0] - values[1]) / 2e-5) ** 2
    return energy * masses.mass * length**2


def segment_place(model, place):
    return model.scene.nodes[place].position


@pytest.mark.parametrize("name", SECTIONS)
def test_small_and_flexible_members_turn_alike(name):
    """The same section and shape, one element of degree eight: one energy of a rigid rotation, one mass."""
    tables = [copy.deepcopy(BODIES[name]) for _ in range(2)]
    tables[1]["members"]["m"]["type"] = "flexible"
    models = [model_of(made(table), 1, 8) for table in tables]
    spin = np.array([0.4, -0.9, 1.2]) if models[0].space else np.array([0, 0, 1.2])
    small, flexible = (turning_energy(model, spin) for model in models)
    # The lumped nodes of the element integrate an arc to this.
    assert small == pytest.approx(flexible, rel=1e-9)
    assert masses_of(models[0]).mass == pytest.approx(masses_of(models[1]).mass, rel=1e-9)


def test_members_with_as_many_points_stand_together():
    """Two straight members and an arc: a group of two and one of one, each with its own mass."""
    table = copy.deepcopy(BODIES["straight"])
    table["nodes"]["C"] = {"position": [1.5, 0.2, 0.1]}
    table["members"]["n"] = {"nodes": ["B", "C"], "section": "s", "type": "small"}
    table["members"]["o"] = copy.deepcopy(BODIES["arc"]["members"]["m"])
    model = model_of(made(table))
    masses = masses_of(model)
    of_bodies = [group for group in masses.observables if type(group.kind).__name__ == "BodyPoints"]
    assert [len(group.data) for group in of_bodies] == [2, 1]
    wanted = [body_of(model.scene, name).weight.total for name in "mno"]
    np.testing.assert_allclose(np.concatenate([g.mass[:, 0] for g in of_bodies]) * masses.mass, wanted, rtol=1e-12)
    assert masses.mass == pytest.approx(sum(wanted), rel=1e-12)


# -- motions --------------------------------------------------------------------------------------------------


def flight(name, integrator):
    """A free body that begins with a rotation about the origin and a velocity: its motion, and these two."""
    table = copy.deepcopy(BODIES[name])
    space = table["dimension"] == "space"
    # Slowly enough for all of them to bend by less than small members may.
    spin = np.array([0.25, -0.5, 1.0]) * (1.0 if space else np.array([0, 0, 1.0]))
    velocity = np.array([0.3, 0.1, -0.2]) * (1.0 if space else np.array([1.0, 1.0, 0]))
    del table["nodes"]["A"]["support"]
    for node in table["nodes"].values():
        node["velocity"] = (velocity + np.cross(spin, node["position"])).tolist()
    table["members"]["m"]["spin"] = spin.tolist() if space else spin[2]
    table["analysis"] = {"type": "dynamic", "end": 1.0, "step": 0.01, "output": 0.25}
    table["analysis"]["integrator"] = integrator
    return sfetcas.solve(made(table)), spin, velocity


FLIGHTS = [(name, "radau-3") for name in ("thick", "arc", "arc, plane", "particles", "thick lumps")]


@pytest.mark.parametrize(("name", "integrator"), [*FLIGHTS, ("thick", "conserving")])
def test_a_free_body_keeps_its_momentum(name, integrator):
    """Of the start both are those of the rigid body; then linear to rounding, angular to the error of the steps."""
    motion, spin, velocity = flight(name, integrator)
    body = body_mass(motion.scene, "m")
    linear = body.mass * (velocity + np.cross(spin, body.centre))
    angular = (np.trace(body.spread) * np.eye(3) - body.spread) @ spin
    kinetic = 0.5 * (linear @ linear / body.mass + spin @ angular)
    for i, step in enumerate(motion.steps):
        # The first is read from the polynomial of the first step, of fifth order; else there is the error of the steps.
        rel = 1e-6 if integrator == "radau-3" and i == 0 else 1e-4
        np.testing.assert_allclose(step.momentum["linear"], linear, atol=1e-9 * np.linalg.norm(linear))
        np.testing.assert_allclose(step.momentum["angular"], angular, atol=rel * np.linalg.norm(angular))
        assert step.energy["total"] == pytest.approx(kinetic, rel=rel)


def test_momentum_of_a_small_member_is_that_of_a_flexible_one():
    """A body that flies past, about a centre of mass that two members have together; seen where nothing bends yet."""
    table = copy.deepcopy(BODIES["thick"])
    del table["nodes"]["A"]["support"]
    table["nodes"]["C"] = {"position": [1.5, 0.2, 0.1]}
    table["members"]["n"] = {"nodes": ["B", "C"], "section": "s", "type": "flexible"}
    spin = np.array([0.5, -1.0, 2.0])
    for node in table["nodes"].values():
        node["velocity"] = np.cross(spin, node["position"]).tolist()
    table["analysis"] = {"type": "dynamic", "end": 0.01, "step": 0.005, "output": 0.01}
    found = []
    for kind in ("small", "flexible"):
        table["members"]["m"] |= {"type": kind, "spin": spin.tolist()}
        table["members"]["n"]["spin"] = spin.tolist()
        found.append(sfetcas.solve(made(table)).steps[0].momentum)
    for key in ("linear", "angular"):
        # Both are read from the polynomial of the first step.
        np.testing.assert_allclose(found[0][key], found[1][key], atol=1e-6 * np.linalg.norm(found[0][key]))


def test_a_small_cantilever_vibrates_with_its_two_modes():
    """A small load is cut: the tip follows the two modes of stiffness and mass of one beam element."""
    ei, rho, force = UNLIKE["EI3"], UNLIKE["rhoA"], 1e-5
    table = {
        "dimension": "plane",
        "sections": {"s": {**UNLIKE}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "type": "small"}},
        "loads": {"f": {"type": "force", "node": "B", "value": [0, force]}},
    }
    k, m = textbook(1.0, 1.0, 1.0, 1.0, ei), textbook_mass(1.0, rho)
    free = np.ix_([7, 11], [7, 11])
    root = np.linalg.inv(np.linalg.cholesky(m[free]))
    squares, modes = np.linalg.eigh(root @ k[free] @ root.T)
    modes = root.T @ modes
    start = np.linalg.solve(k[free], [force, 0])
    period = 2 * np.pi / np.sqrt(squares[0])
    table["analysis"] = {"type": "dynamic", "initial": "equilibrium", "cut": ["f"], "end": period, "step": period / 200}
    motion = sfetcas.solve(made(table))
    shares = modes.T @ m[free] @ start
    wanted = modes[0] @ (shares[:, None] * np.cos(np.sqrt(squares)[:, None] * motion.times))
    # Steps of fifth order, a few tens of them in a period of the second mode.
    np.testing.assert_allclose(motion.positions("B")[:, 1], wanted, atol=1e-4 * abs(start[0]))


# -- refusals -------------------------------------------------------------------------------------------------


def refused(mass, rest=PLACES):
    """What the scene or, where that takes it, the points say."""
    table = condensed(mass, rest)
    with pytest.raises(SceneError) as caught:
        Points(table)
    return str(caught.value)


def test_a_mass_that_differs_by_direction():
    mass = lumps((0.5, 0.5, 1.0))
    turn = np.kron(np.eye(6), own_axes(made(BODIES["straight"]), "m"))
    mass[0, 0] = 0.3
    mass = turn @ mass @ turn.T
    assert refused(mass) == (
        "members.m.mass: found 1.8, 2, 2 kg along b1, b2, b3 in rigid motion, accepted: one mass along all"
    )
    coupled = lumps((0.5, 0.5, 1.0))
    coupled[0, 1] = coupled[1, 0] = 0.1
    assert "coupled by 0.1 kg in rigid motion, accepted: one mass along all" in refused(turn @ coupled @ turn.T)


def test_a_mass_without_translation():
    assert "accepted: one mass along all" in refused(lumps((0, 0, 0), (1, 1, 1)))


def test_a_mass_that_is_negative():
    assert "members.m.mass: is indefinite: eigenvalue -0.1 of the shape [" in refused(lumps((0.5, 0.5, -0.1)))


def test_a_mass_without_a_centre():
    mass = lumps((0.5, 0.5, 1.0), (1.0, 1.0, 1.0))
    mass[:3, 3:6], mass[3:6, :3] = 0.2 * np.eye(3), 0.2 * np.eye(3)
    assert "members.m.mass: has no centre of mass: turning about b1 has momentum along b1" in refused(mass)


@pytest.mark.parametrize("kind", ["condensed", "section"])
def test_moments_of_inertia_that_no_body_has(kind):
    if kind == "condensed":
        found = refused(lumps((0.1, 0.1, 0.1), (1.0, 0.0, 0.0)))
    else:
        with pytest.raises(SceneError) as caught:
            masses_of(model_of(made(body(section=UNLIKE | {"rhoI": [1.0, 0.1, 0.1]}))))
        found = str(caught.value)
    assert found.startswith("members.m: found principal moments of inertia ")
    assert found.endswith(" kg m2, accepted: those of a body, none more than the sum of the others")


def test_a_member_without_mass_has_no_points():
    table = copy.deepcopy(BODIES["straight"])
    del table["sections"]["s"]["rhoA"]
    assert body_mass(made(table), "m") is None
    assert not mass_of(made(table), "m").any()
    assert body_mass(made(condensed(np.zeros((18, 18)), PLACES)), "m") is None
