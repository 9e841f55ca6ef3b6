"""Loads without potential on paths: where the static tangent becomes singular; pressure, which has a potential."""

import numpy as np
import pytest
from scenes import made
from test_paths import PROBLEMS, curve_of

from sfetcas import Prepared, Scene, SceneError, load, solve
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble
from sfetcas.mechanics.pressure import is_pressure
from sfetcas.solvers.beginning import begin_path
from sfetcas.solvers.tracing import trace


def column(follower, space=False, **analysis):
    """A clamped column under an end force of which a share follows the end."""
    return {
        "dimension": "space" if space else "plane",
        "sections": {"strip": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}},
        "nodes": {"foot": {"position": [0, 0], "support": "clamped"}, "head": {"position": [1, 0]}},
        "members": {"column": {"nodes": ["foot", "head"], "section": "strip"}},
        "loads": {
            "dead": {"type": "force", "node": "head", "value": [follower - 1.0, 0]},
            "following": {"type": "force", "node": "head", "value": [-follower, 0], "frame": "follower"},
        },
        "analysis": {"type": "path", "range": [0, 30], "accuracy": 1e-7} | analysis,
    }


def ring(parts=2, pressure=1.0, **analysis):
    angle = 2.0 * np.pi / parts
    places = [[np.cos(i * angle), np.sin(i * angle)] for i in range(parts)]
    shape = {"type": "arc", "angle": angle}
    ends = [[f"{i}", f"{(i + 1) % parts}"] for i in range(parts)]
    load = {"type": "distributed", "value": [0, pressure], "frame": "section"}
    return {
        "sections": {"strip": {"EI3": 1.0}},
        "nodes": {f"{i}": {"position": p} | {"support": "free" if i else "clamped"} for i, p in enumerate(places)},
        "members": {f"{i}": {"nodes": pair, "section": "strip", "shape": shape} for i, pair in enumerate(ends)},
        "loads": {f"{i}": load | {"member": f"{i}"} for i in range(parts)},
        "analysis": {"type": "path", "range": [0, 10]} | analysis,
    }


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("follower", [0.3, 0.45])
def test_column_under_a_force_that_follows_in_part(follower, space):
    """It diverges where (1 - a) cos(k) + a = 0, P = k^2 (Herrmann and Bungay 1964), in space to all sides at once."""
    path = solve(made(column(follower, space)))
    k = np.arccos(follower / (follower - 1.0))
    # 1e-8 of the factors, as critical points elsewhere.
    assert path.main.factors[-1] == 30.0
    np.testing.assert_allclose([b.factor for b in path.bifurcations], [k**2, (2.0 * np.pi - k) ** 2], rtol=1e-8)
    for point in path.bifurcations:
        assert point.certificate.stable == "not defined"
        assert "static divergence" in point.notes[0]
        assert [note[:1] for note in point.notes[1:]] == ["2"] * space
    assert any("flutter would only show with the key 'modes'" in note for note in path.notes)


@pytest.mark.parametrize("space", [False, True])
def test_column_whose_force_follows_more_than_by_half_never_diverges(space):
    path = solve(made(column(0.6, space, accuracy=1e-4)))
    assert (path.bifurcations, path.limit_points) == ((), ())


def arch(frame):
    member = {"section": "strip", "shape": {"type": "arc", "angle": -0.5}, "element": "SFET5", "elements": 3}
    return {
        "sections": {"strip": {"EI3": 1.0}},
        "nodes": {
            "left": {"position": [-1, 0], "support": "hinge"},
            "crown": {"position": [0, np.tan(0.25)]},
            "right": {"position": [1, 0], "support": "hinge"},
        },
        "members": {
            "left": member | {"nodes": ["left", "crown"]},
            "right": member | {"nodes": ["crown", "right"]},
        },
        "loads": {"crown": {"type": "force", "node": "crown", "value": [0, -1], "frame": frame}},
        "analysis": {"type": "path", "range": [-60, 60], "points": 60},
    }


def test_limit_loads_of_a_symmetric_path_are_those_of_a_dead_load():
    """The crown does not turn on it: what follows differs in its bifurcations only."""
    dead, following = (solve(made(arch(frame))) for frame in ("fixed", "follower"))
    assert len(dead.limit_points) >= 1
    found, wanted = ([p.factor for p in path.limit_points] for path in (following, dead))
    np.testing.assert_allclose(found, wanted, rtol=1e-8)
    found, wanted = ([p.factor for p in path.bifurcations] for path in (following, dead))
    assert abs(found[0] / wanted[0] - 1.0) > 1e-3


def test_pressed_ring_loses_its_stability_to_two_shapes_at_once():
    table = ring(range=[0, 7])
    for member in table["members"].values():
        member |= {"element": "SFET7", "elements": 3}
    path = solve(made(table))
    assert [stable for stable, *_ in path.main.stretches()] == [True, False]
    # What three elements of order 12 to each half leave; two simple roots apart would be two bifurcations.
    np.testing.assert_allclose([p.factor for p in path.bifurcations], [3.0], rtol=1e-6)
    assert all("2 eigenvalues vanish at once" in p.notes[0] for p in path.bifurcations)


def test_pressed_ring_whose_shape_may_go_round_is_followed_until_its_sides_touch():
    """Opposite sides touch at 5.247 EI/R^3 (Tadjbakhsh and Odeh 1967, and a quarter of the ring).

    The mesh resists what the ring does not: its shape may go round it.
    """
    table = ring(4, range=[0, 6], branches=1, steps=[5.247])
    for member in table["members"].values():
        member |= {"element": "SFET8", "elements": 3}
    path = solve(made(table))
    assert [part.end for part in path.branches[1:]] == ["the factor leaves the range at 6"] * 2
    for entry in path.steps[1:]:
        places = np.vstack([entry.fields.along(name, np.linspace(0.0, 1.0, 1001)[:-1])["position"] for name in "0123"])
        # The pair of places that is nearest to those that touch is off by half their distance, to both sides.
        assert np.linalg.norm(places - np.roll(places, 2000, axis=0), axis=1).min() < 0.5 * np.pi / 1000 + 5e-4
        assert entry.certificate.stable == "neutral"
        assert entry.certificate.residual < 1e-8


def test_tangent_under_pressure_is_symmetric_but_for_the_mesh():
    def skew(table, elements):
        curve, _ = curve_of(made(table), elements)
        here = curve.prepared.correct(curve.equations.start(curve.loading(0.0)), curve.loading(1.0), iterations=30)
        test = curve.prepared._tangent
        tangent = test._tangent(here.point)[0]
        lowest = np.linalg.eigh(tangent + tangent.T)[1][:, :4]
        return np.abs(lowest.T @ (tangent - tangent.T) @ lowest).max()

    cantilever = ring()
    cantilever["members"].pop("1")
    cantilever["loads"].pop("1")
    # Of the lowest shapes; of the highest that a mesh carries it falls more slowly.
    assert skew(ring(), 4) < 1e-2 * skew(ring(), 2)
    assert skew(cantilever, 4) > 0.1


def test_ring_that_may_roll_buckles_at_the_twist_of_michell():
    """A neutral direction all along the path, and two eigenvalues that vanish at once, on one coarse mesh."""
    scene = load(PROBLEMS / "ring_twisted.toml")
    prepared = Prepared(assemble(scene, uniform_mesh(scene, 4, 4)))
    curve, start, _ = begin_path(prepared, scene.analysis.span)
    assert (start.inertia.negative, start.inertia.zero) == (0, 1)
    (event,) = trace(curve, start, scene.analysis.span, 200).events
    assert (event.kind, event.multiplicity) == ("bifurcation", 2)
    # What sixteen elements of order eight leave; the two eigenvalues differed by 1e-5 of it where they were not met.
    assert event.standing.factor == pytest.approx(2.0 * np.pi * np.sqrt(3.0) / 0.75, rel=2e-7)


def changed(change):
    table = ring(3)
    change(table)
    return Scene.from_dict(table)


@pytest.mark.parametrize(
    ("holds", "change"),
    [
        (True, lambda t: None),
        (True, lambda t: t["loads"]["1"].update(profile=1.0)),
        (True, lambda t: t["nodes"]["1"].update(joint="hinge")),
        (False, lambda t: t["loads"]["1"].update(value=[0, 2])),
        (False, lambda t: t["loads"]["1"].update(value=[0.1, 1])),
        (False, lambda t: t["loads"]["1"].update(profile={"polynomial": [1, 0.1]})),
        (False, lambda t: t["loads"].pop("1")),
        (False, lambda t: t["loads"].update(more={"type": "force", "node": "1", "value": [1, 0], "frame": "follower"})),
        # Pressures may differ where a support holds the node between them.
        (True, lambda t: (t["loads"]["0"].update(value=[0, 2]), t["nodes"]["1"].update(support="hinge"))),
    ],
)
def test_what_is_pressure(holds, change):
    assert is_pressure(changed(change)) is holds


def test_load_in_the_axes_of_the_section_follows_it():
    def cantilever(**load):
        nodes = {"root": {"position": [0, 0, 0], "support": "clamped"}, "tip": {"position": [0, 0, 1]}}
        member = {"nodes": ["root", "tip"], "section": "rod", "b2": [1, 0, 0]}
        return {
            "sections": {"rod": {"EI2": 1.0, "EI3": 2.0, "GJ": 0.8}},
            "nodes": nodes,
            "members": {"rod": member},
            "loads": {"spread": {"type": "distributed", "member": "rod"} | load},
        }

    # b1 is z, b2 is x, b3 is y.
    one = solve(made(cantilever(frame="section", value=[0.3, 2.0, 1.0]))).last
    other = solve(made(cantilever(frame="follower", value=[2.0, 1.0, 0.3]))).last
    np.testing.assert_allclose(one.position("tip"), other.position("tip"), atol=1e-10)
    assert one.position("tip")[0] > 0.1


def test_only_distributed_loads_are_in_the_axes_of_sections():
    table = column(0.3)
    table["loads"]["dead"]["frame"] = "section"
    with pytest.raises(SceneError, match=r"loads.dead.frame: found 'section', accepted of a force: fixed or follower"):
        Scene.from_dict(table)
