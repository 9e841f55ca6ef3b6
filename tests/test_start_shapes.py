"""Motions that begin with a deformed shape: given by rotations along members, against loads that are cut."""

import re

import numpy as np
import pytest

import sfetcas
from sfetcas import Scene, SceneError

EI, K = 2.0, 1.5
"""Bending stiffness, N m2, and curvature, 1/m, of a beam of one metre."""

SHORT = {"type": "dynamic", "end": 0.02, "output": 0.02, "step": 0.002, "accuracy": 1e-3}
"""A few steps of a given size, so that two motions are compared on the same mesh and steps."""


def beam(dimension="plane", *, turned=None, analysis=None, support="clamped", **more):
    """A beam along x, clamped at its begin."""
    table = {
        "dimension": dimension,
        "sections": {"s": {"EI3": EI, "EI2": EI, "GJ": 1.5, "rhoA": 1.0, "rhoI": [0.002, 0.001, 0.001]}},
        "nodes": {"A": {"position": [0, 0], "support": support}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "analysis": {**SHORT, **(analysis or {})},
        **more,
    }
    if turned is not None:
        table["members"]["m"]["turned"] = turned
    return Scene.from_dict(table)


CIRCLE = {
    "plane": {"polynomial": [0, K]},
    "formula": f"{K} * x",
    "table": {"at": [0, 0.5, 1], "value": [0, 0.5 * K, K]},
    "space": [0, 0, {"polynomial": [0, K]}],
}


@pytest.mark.parametrize("kind", CIRCLE)
def test_circle(kind):
    """Bent to a circle and let go: the energy of the begin is that of the curvature, and it is kept."""
    analysis = {"integrator": "conserving"}
    motion = sfetcas.solve(beam("space" if kind == "space" else "plane", turned=CIRCLE[kind], analysis=analysis))
    exact = np.array([np.sin(K), 1.0 - np.cos(K), 0.0]) / K
    # The rotation is linear along the elements: what is left is their integration.
    np.testing.assert_allclose(motion.steps[0].position("B"), exact, atol=1e-6)
    energies = [step.energy for step in motion.steps]
    assert energies[0]["total"] == pytest.approx(0.5 * EI * K**2, rel=1e-9)
    # What the jump of the moment at the end sends as waves through steps of this size is told with less accuracy.
    assert energies[-1]["total"] == pytest.approx(0.5 * EI * K**2, rel=2e-2)
    assert energies[-1]["kinetic"] > 0.1
    assert motion.notes == ()


def test_energy_is_kept():
    """Without moment and shear at the free end, so that nothing jumps as it is let go."""
    scene = beam(turned={"polynomial": [0, 3, -3, 1]}, analysis={"integrator": "conserving"})
    energies = [step.energy for step in sfetcas.solve(scene).steps]
    exact = 0.5 * EI * 9.0 / 5.0
    assert energies[0]["total"] == pytest.approx(exact, rel=1e-9)
    # Second order in steps of this size; the energy at the end of a step is that of its discrete derivatives.
    assert energies[-1]["total"] == pytest.approx(exact, rel=1e-5)
    assert energies[-1]["kinetic"] > 0.02


@pytest.mark.parametrize("dimension", ["plane", "space"])
def test_as_the_loads_that_are_cut(dimension):
    """The shape of an equilibrium gives the motion that cutting its load gives, and so do its velocities."""
    load = {"p": {"type": "moment", "node": "B", "value": EI * K if dimension == "plane" else [0.8, -1.1, EI]}}
    cut = beam(dimension, analysis={"initial": "equilibrium", "cut": ["p"]}, loads=load)
    before = sfetcas.solve(Scene.from_dict({**cut.to_dict(), "analysis": {"accuracy": 1e-9}})).last
    x = np.linspace(0.0, 1.0, 201)
    vectors = [sfetcas.mathematics.quaternion.rotation_vector(q) for q in before.along("m", x)["quaternion"]]
    parts = [{"at": x.tolist(), "value": np.ravel(column).tolist()} for column in np.array(vectors).T]
    if dimension == "plane":
        parts = {"polynomial": [0, K]}
    else:
        # Polynomials through the rotation vectors, so that elements need no end at the places of a table.
        fits = [np.polynomial.Polynomial.fit(x, part["value"], 10).convert().coef for part in parts]
        parts = [{"polynomial": [0.0, *fit[1:].tolist()]} for fit in fits]
    begun = beam(dimension, turned=parts)
    one, other = (sfetcas.solve(scene) for scene in (cut, begun))
    for a, b in zip(one.steps, other.steps, strict=True):
        # The equilibrium before is found to a tenth of the accuracy.
        np.testing.assert_allclose(a.position("B"), b.position("B"), atol=1e-4)
        assert a.energy["total"] == pytest.approx(b.energy["total"], rel=1e-3)
    assert np.linalg.norm(one.steps[-1].position("B") - one.steps[0].position("B")) > 0.02


def test_of_what_is_free():
    """What nothing holds keeps the place of its first node, and flies with the momentum that it is given."""
    scene = beam(turned={"polynomial": [0.3, K]}, support="free")
    scene = scene.replace({"nodes.A.velocity": [0, 1], "members.m.spin": 0.5})
    motion = sfetcas.solve(scene)
    np.testing.assert_allclose(motion.steps[0].position("A"), 0.0, atol=1e-12)
    end = (np.array([np.sin(0.3 + K), -np.cos(0.3 + K)]) - [np.sin(0.3), -np.cos(0.3)]) / K
    np.testing.assert_allclose(motion.steps[0].position("B")[:2], end, atol=1e-6)
    # Every section turns as fast, so that it turns as a body.
    np.testing.assert_allclose(motion.steps[0].velocity("B")[:2], [-0.5 * end[1], 1.0 + 0.5 * end[0]], atol=1e-6)


def frame(**turned):
    """Two beams at a right angle, rigidly joined."""
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": EI, "rhoA": 1.0}},
            "nodes": {
                "A": {"position": [0, 0], "support": "clamped"},
                "B": {"position": [1, 0]},
                "C": {"position": [1, 1]},
            },
            "members": {
                name: {"nodes": nodes, "section": "s", **({"turned": turned[name]} if name in turned else {})}
                for name, nodes in (("one", ["A", "B"]), ("two", ["B", "C"]))
            },
            "analysis": SHORT,
        }
    )


def test_of_a_frame():
    motion = sfetcas.solve(frame(one={"polynomial": [0, K]}, two=K))
    exact = np.array([np.sin(K), 1.0 - np.cos(K)]) / K + [-np.sin(K), np.cos(K)]
    np.testing.assert_allclose(motion.steps[0].position("C")[:2], exact, atol=1e-6)
    assert motion.steps[0].energy["elastic"] == pytest.approx(0.5 * EI * K**2, rel=1e-9)


def guided(turned):
    return beam(turned=turned, support="hinge").replace(
        {"nodes.B": {"position": [1, 0], "support": "slider", "direction": [1, 0], "rotation": "hinge"}}
    )


def test_closings():
    """A shape that closes is as it is; one that misses little is closed, and told; one that misses more is refused."""
    shape = "0.6 * cos(pi * x)"
    motion = sfetcas.solve(guided(shape))
    assert motion.notes == ()
    assert motion.steps[0].position("B")[1] == 0.0
    near = sfetcas.solve(guided(f"{shape} + 2e-4"))
    assert re.match(r"the shape at t = 0 missed closings by \d.\de-04 of the size: it was changed", near.notes[0])
    np.testing.assert_allclose(near.steps[0].position("B"), motion.steps[0].position("B"), atol=1e-3)
    with pytest.raises(SceneError, match=r"members\.m\.turned: the shape at t = 0 misses .* by 0\.0\d+ of the size"):
        sfetcas.solve(guided(f"{shape} + 0.05"))


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (lambda: frame(one={"polynomial": [0, K]}, two=1.0), "members.two.turned: turns what it shares with the"),
        (lambda: frame(one={"polynomial": [0, K]}), "members.two: the key 'turned' is missing: it is joined to"),
        (lambda: beam(turned=0.3), "members.m.turned: turns what a support holds by 0.3 rad"),
        (lambda: beam("space", turned=0.3), "members.m.turned: found 0.3, accepted: a rotation vector [x, y, z]"),
        (lambda: beam("plane", turned=[0.1, 0, 0]), "members.m.turned is not about z"),
        (lambda: beam(turned="1 / x"), "members.m.turned"),
        (lambda: beam(turned=[1, 2, 3, 4]), "members.m.turned: found 4 entries, accepted: three"),
        (lambda: beam(turned=0.0, analysis={"initial": "equilibrium"}), "found with initial = 'equilibrium'"),
        (
            lambda: Scene.from_dict({**beam(turned=0.0).to_dict(), "analysis": {}}),
            "members.m.turned: found the analysis 'static'",
        ),
        (
            lambda: beam("space", turned=[0.2, 0, 0], support="hinge"),
            "members.m.turned: turns a hinge by 0.2 rad across its axis",
        ),
    ],
)
def test_refused(scene, words):
    with pytest.raises(SceneError, match=re.escape(words)):
        sfetcas.solve(scene())
