"""Tendons through discs: lengths between them as functions of rotations, against places of the discs as unknowns."""

import casadi as ca
import numpy as np
import pytest
from test_tendons import D, T, robot, rod

import sfetcas
from sfetcas import Scene, Settings
from sfetcas.equilibria.meshing import Meshing
from sfetcas.mechanics import segments, terms
from sfetcas.mechanics.elements import element_by_name
from sfetcas.mechanics.tendon_terms import Spanned

WAY = [{"member": "m", "offset": D, "discs": 5}]


def places(scene):
    """Number of displacement unknowns of the answer, beside strains and elongations."""
    names = sfetcas.solve(scene).last.model.positions.unknowns
    return sum(not name.startswith(("strain", "elongation")) for name in names)


@pytest.fixture
def without(monkeypatch):
    """A function that lets the discs be places from then on, the independent way to the same answers."""
    return lambda: monkeypatch.setattr(segments, "MOST_COUPLED", 0)


def told(scene, **settings):
    """All that is told of a scene, one after the other."""
    step, found = sfetcas.solve(scene, **settings).last, []
    for name, node in scene.nodes.items():
        found += [step.position(name), *(step.reaction(name) if node.support != "free" else ())]
    for name in scene.members:
        along = step.along(name, [0.0, 0.03, 0.25, 0.5, 0.77, 1.0])
        found += [
            along[key] for key in ("position", "moment", "force", "curvature", *("strain",) * ("strain" in along))
        ]
    found += [list(step.tendon(name).values()) for name in scene.tendons]
    return np.concatenate([np.ravel(np.asarray(part, dtype=float)) for part in [*found, [step.potential]]])


def curved():
    """A rod bent from the beginning, under a dead force, and one that turns with it between two discs."""
    scene = rod(WAY, tension=T).to_dict()
    scene["nodes"]["B"]["position"] = [0.9, 0.4]
    scene["members"]["m"]["shape"] = {"type": "arc", "angle": 0.8}
    loads = {"dead": {"type": "force", "node": "B", "value": [0.5, -1.0]}}
    loads["turning"] = {"type": "force", "member": "m", "at": 0.5, "value": [0, 1.0], "frame": "follower"}
    return Scene.from_dict({**scene, "loads": loads})


def held():
    """Clamped at both ends, so that nothing says which force goes through it."""
    return rod(WAY).replace({"nodes.B.support": "clamped"})


def between_rigid_members():
    """Rigid members at both ends, whose moments follow from the balance of the nodes."""
    scene = rod(WAY, "space", tension=T).to_dict()
    scene["nodes"] |= {"F": {"position": [-0.3, 0.1], "support": "clamped"}, "C": {"position": [1.2, 0.3]}}
    scene["members"] |= {"foot": {"nodes": ["F", "A"], "type": "rigid"}, "hand": {"nodes": ["B", "C"], "type": "rigid"}}
    return Scene.from_dict({**scene, "loads": {"p": {"type": "force", "node": "C", "value": [0.5, -1.0, 0.3]}}})


SCENES = {
    "rigid": between_rigid_members,
    "plane": lambda: rod(WAY, "plane", tension=T),
    "backwards": lambda: rod([{"member": "m", "offset": D, "discs": [0.9, 0.3, 0.1]}], "space", tension=T),
    "pull": lambda: rod(WAY, "space", pull=0.01),
    "elastic": lambda: rod(WAY, "plane", pull=0.05, stiffness=500.0),
    "slack": lambda: rod(WAY, "plane", pull=-0.05),
    "ground": lambda: rod([{"ground": [-0.2, 0.3]}, *WAY, {"ground": [1.5, 1.0]}], tension=T),
    "helix": lambda: rod([{"member": "m", "helix": {"radius": 0.05, "turns": 1.5}, "discs": 8}], tension=12.0),
    "curved": curved,
    "held": held,
    "stretching": lambda: rod(WAY, "plane", tension=T).replace({"sections.s.EA": 500.0, "sections.s.GA2": 200.0}),
}


@pytest.mark.parametrize("name", SCENES)
def test_places_are_not_needed(name, without):
    """Everything that is told is the same with the displacements of the discs as unknowns."""
    scene = SCENES[name]()
    few, found = places(scene), told(scene, accuracy=1e-9)
    without()
    assert few <= places(scene) - 3
    exact = told(scene, accuracy=1e-9)
    # Rounding of Newton's method in either.
    np.testing.assert_allclose(found, exact, rtol=1e-9, atol=1e-9 * np.abs(exact).max())


@pytest.mark.parametrize("pull", [{"tension": T}, {"pull": 0.02}, {"pull": 0.03, "stiffness": 500.0}])
def test_meshes_on_which_places_are_needed(pull, without):
    """Where a mesh becomes so fine that places are less work the answer goes on from mesh to mesh."""
    more = {} if "tension" in pull else {"pushes": True}
    loads = {"p": {"type": "force", "node": "B", "value": [-30.0, -10.0]}}
    scene = Scene.from_dict({**rod([{**WAY[0], "discs": 2}], "plane", **pull, **more).to_dict(), "loads": loads})
    coarse, fine = sfetcas.solve(scene, accuracy=1e-1).last, sfetcas.solve(scene, accuracy=1e-9).last
    assert len(coarse.model.positions.unknowns) < len(fine.model.positions.unknowns)
    assert "refound" not in fine.way
    without()
    np.testing.assert_allclose(fine.position("B"), sfetcas.solve(scene, accuracy=1e-9).last.position("B"), atol=1e-9)


@pytest.mark.parametrize(("given", "strains"), [(False, True), (True, False)])
def test_derivatives_by_points(given, strains):
    """Put together from single points they are those of the whole expression."""
    kind = Spanned(True, given, element_by_name("SFET2", True, False, strains), 2)
    random = np.random.default_rng(3)
    turns, moved, rows, data, load = kind.sizes
    q = random.normal(size=(4, turns))
    q /= np.linalg.norm(q, axis=0)
    arguments = [q, random.normal(size=(3, moved)), *(random.normal(size=n) for n in (data, load, rows))]
    pairs = [
        (kind.rotation_gradient(), terms._rotation_gradient(kind), arguments),
        (kind.slopes(), terms._slopes(kind), arguments[:4]),
        (kind.curvatures(), terms._curvatures(kind), [*arguments, 0.7]),
    ]
    pairs.append((kind.rotation_forces(), ca.Function("f", *forces_of(terms._rotation_gradient(kind))), arguments))
    for function, whole, at in pairs:
        for found, exact in zip(function.call(at), whole.call(at), strict=True):
            # Rounding of sums of some hundred products.
            np.testing.assert_allclose(np.array(found), np.array(exact), atol=1e-12)


def forces_of(whole):
    """Arguments, and rows and gradient, of a function of all derivatives."""
    symbols = whole.sx_in()
    return symbols, whole.call(symbols)[2:4]


@pytest.mark.parametrize(
    ("dimension", "pull"),
    [
        ("plane", {"tension": T}),
        ("plane", {"pull": 0.02, "stiffness": 500.0}),
        ("space", {"pull": 0.01, "pushes": True}),
    ],
)
def test_parameters(dimension, pull, without):
    """Answers of parametric solvers and their derivatives, beside those with places."""
    asked = ["nodes.B.position", "tendons.t.tension", "tendons.t.length", "reactions.A.moment"]
    asked += [f"members.m.{key} at 0.31" for key in ("position", "moment", "force", "curvature")]
    key, value = next(iter(pull.items()))
    names, scene = [f"tendons.t.{key}", "tendons.t.way.0.offset.0"], rod(WAY, dimension, **pull)
    found = []
    for change in (lambda: None, without):
        change()
        answer = sfetcas.parametric(scene, names, asked).solve({names[0]: 1.3 * value})
        found.append([np.concatenate([np.ravel(answer[name]) for name in asked]), answer.flat_jacobian])
    for part, exact in zip(*found, strict=True):
        np.testing.assert_allclose(part, exact, rtol=1e-9, atol=1e-9 * np.abs(exact).max())


def test_workspace():
    """Any tensions of the robot are found in a few steps of Newton's method, from anywhere."""
    names = ["tendons.a.tension", "tendons.b.tension"]
    family, random = sfetcas.parametric(robot(True), names, ["nodes.tip.position"]), np.random.default_rng(5)
    start = family.solve()
    for values in random.uniform(0.0, [4.0, 2.0], (12, 2)).tolist():
        for begin in (None, start):
            assert family.solve(dict(zip(names, values, strict=True)), start=begin).outcome.iterations <= 6


def test_short_elements():
    """Order 4 is enough where discs make elements short, not where these bend much, nor along a member."""
    scenes = {"discs": robot(True), "much": robot(True, (12.0, 6.0)), "along": robot(False)}
    orders = {name: Meshing(scene, Settings(accuracy=1e-9)).target.order for name, scene in scenes.items()}
    assert orders == {"discs": 4, "much": 6, "along": 6}


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_strains_as_answers(dimension):
    """Parametric solvers tell of strains what statics does, with their derivatives, through discs under loads."""
    scene = rod(WAY, dimension, tension=T).to_dict()
    scene["sections"]["s"] |= {"EA": 500.0, "GA2": 200.0, **({"GA3": 150.0} if dimension == "space" else {})}
    across = 2.0 if dimension == "space" else 0.0
    scene["loads"] = {"p": {"type": "force", "node": "B", "value": [1.0, -3.0, across]}}
    scene["nodes"]["B"]["position"] = [0.9, 0.4]
    family = sfetcas.parametric(Scene.from_dict(scene), ["sections.s.EA"], ["members.m.strain at 0.31"])
    found = family.solve()
    exact = sfetcas.solve(Scene.from_dict(scene)).last.along("m", [0.31])["strain"][0]
    # Of two meshes, each with an error of 1e-6 at most.
    np.testing.assert_allclose(found["members.m.strain at 0.31"], exact, atol=1e-6)
    low, high = (family.solve({"sections.s.EA": ea}, start=found)["members.m.strain at 0.31"] for ea in (495.0, 505.0))
    slope = found.jacobian["members.m.strain at 0.31"]["sections.s.EA"].ravel()
    # Of differences over a hundredth of what changes, the square is left.
    np.testing.assert_allclose(slope, (high - low) / 10.0, rtol=1e-3, atol=1e-9)
