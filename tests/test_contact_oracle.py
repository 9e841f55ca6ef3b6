"""The chains of rigid links that judge contact, against what is known without them; and contact against them."""

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.contact_chain import QUARTERS, NotAChainError
from benchmarks.contact_oracle import NARROW, chain_contact
from benchmarks.contact_run import APART
from benchmarks.contact_scenes import FAMILIES, contact_scene
from sfetcas import Scene, solve

TIP = [0.445004402246249, 0.810609024880296]
"""Of a cantilever under F L^2/EI = 10, elliptic integrals."""


def cantilever(dimension="plane", **more):
    """Straight along x, L = EI = 1."""
    section = {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}
    nodes = {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}}
    members = {"b": {"nodes": ["A", "B"], "section": "s"}}
    return {"dimension": dimension, "sections": {"s": section}, "nodes": nodes, "members": members, **more}


def force(*value):
    return {"f": {"type": "force", "node": "B", "value": list(value)}}


def peg(center, radius):
    return {"peg": {"type": "circle", "center": center, "radius": radius, "members": "all"}}


@pytest.mark.parametrize(("dimension", "value"), [("plane", [0, 10]), ("space", [0, 0, 10])])
def test_chain_bends_as_the_elastica(dimension, value):
    found = chain_contact(cantilever(dimension, loads=force(*value)))
    assert found.nodes["B"][[0, len(value) - 1]] == pytest.approx(TIP, abs=0.3 * found.error)
    # Of second order: with N = 20 and 12 links the error is some (1/N)^2.
    assert found.error < 5e-3


def test_chain_twists_and_bends_in_space():
    """The 45-degree bend of Bathe and Bolourchi under 600, (15.68, 47.15, 53.47) in its own axes."""
    stiff = 1e7 / 12.0
    scene = cantilever("space", loads=force(0, 0, 600))
    scene["sections"]["s"] = {"EI2": stiff, "EI3": stiff, "GJ": stiff}
    scene["nodes"]["B"]["position"] = [100 * np.sin(np.pi / 4), 100 * (1 - np.cos(np.pi / 4))]
    scene["members"]["b"]["shape"] = {"type": "arc", "angle": np.pi / 4}
    assert chain_contact(scene).nodes["B"] == pytest.approx([47.15, 15.68, 53.47], abs=0.01)


def test_rigid_bar_is_stopped_by_a_peg():
    """By geometry: at atan2(.3, .8) - asin(.1/hypot(.8, .3)); moments about the hinge give the force."""
    scene = cantilever(contacts=peg([0.8, 0.3], 0.1), loads={"m": {"type": "moment", "node": "B", "value": 1.5}})
    scene["nodes"]["A"]["support"] = "hinge"
    scene["members"]["b"]["type"] = "rigid"
    scene["springs"] = {"k": {"type": "rotational", "node": "A", "stiffness": 1.0}}
    angle = np.arctan2(0.3, 0.8) - np.arcsin(0.1 / np.hypot(0.8, 0.3))
    found = chain_contact(scene)
    # What obstacles can be entered by at most, with force 1.2 EI/L^2 at half of it.
    assert found.nodes["B"] == pytest.approx([np.cos(angle), np.sin(angle), 0.0], abs=5e-5)
    ((_, at, pushed),) = found.touches["peg"]
    arm = np.sqrt(0.8**2 + 0.3**2 - 0.1**2)
    assert (at, pushed) == pytest.approx((arm, (1.5 - angle) / arm), abs=1e-4)


def test_heavy_strip_lies_on_a_floor():
    """A clamped strip above a floor by q a^4/(72 EI) touches it from a on, with q a/3 there (small deflections)."""
    q, a = 2.0, 0.5
    floor = {"type": "plane", "point": [0, -q * a**4 / 72], "normal": [0, 1], "members": "all"}
    load = {"q": {"type": "distributed", "member": "b", "value": [0, -q]}}
    touches = chain_contact(cantilever(contacts={"floor": floor}, loads=load)).touches["floor"]
    # A link, 1/40, to either side.
    assert min(at for _, at, _ in touches) == pytest.approx(a, abs=0.026)
    assert sum(pushed for _, _, pushed in touches) == pytest.approx(q * (1 - a) + q * a / 3, rel=0.02)


def test_nothing_passes_through_a_peg():
    """A tip pulled hard past a peg stays before it, (0.9445, 0.2772) by paths in contact."""
    found = chain_contact(cantilever(contacts=peg([0.8, 0.3], 0.1), loads=force(0, 12)))
    assert found.nodes["B"][:2] == pytest.approx([0.9445, 0.2772], abs=5e-4)
    assert not found.snapped


def test_what_slips_off_a_peg_has_snapped():
    """A strip rolled up by a moment slips past the peg in its way, and is then a circular arc again."""
    scene = cantilever(contacts=peg([1.02, 0.2], 0.06), loads={"m": {"type": "moment", "node": "B", "value": 6.0}})
    found = chain_contact(scene)
    assert found.snapped
    assert found.nodes["B"][:2] == pytest.approx([np.sin(6.0) / 6.0, (1.0 - np.cos(6.0)) / 6.0], abs=1e-5)


@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
def test_a_beam_on_a_round_solid_in_space_touches_it(kind):
    """In the plane of symmetry both are the circle of the same radius."""
    solid = {"type": kind, "center": [0.7, 0, -0.4], "axis": [0, 1, 0], "radius": 0.35, "members": "all"}
    circle = {"type": "circle", "center": [0.7, -0.4], "radius": 0.35, "members": "all"}
    space = chain_contact(cantilever("space", contacts={"o": solid}, loads=force(0, 0, -2)), links=6)
    plane = chain_contact(cantilever(contacts={"o": circle}, loads=force(0, -2)), links=6)
    assert space.nodes["B"][[0, 2]] == pytest.approx(plane.nodes["B"][:2], abs=1e-3)


def test_inside_of_a_drum():
    """The free tip of a strip pressed against the inside of a drum is on it."""
    drum = {"d": {"type": "circle", "center": [0.5, 0], "radius": 0.7, "members": "all", "side": "inside"}}
    found = chain_contact(cantilever(contacts=drum, loads=force(0, -40)))
    assert np.hypot(*(found.nodes["B"][:2] - [0.5, 0])) == pytest.approx(0.7, abs=1e-4)


@pytest.mark.parametrize("change", [{"rotating": [0, 0, 1]}, {"loads": {"f": {"type": "force", "follower": True}}}])
def test_what_a_chain_does_not_know_is_refused(change):
    with pytest.raises(NotAChainError, match="not known"):
        chain_contact(cantilever(**change))


@pytest.mark.parametrize("family", FAMILIES)
def test_random_scenes_start_clear_of_their_obstacles(family):
    """At least one obstacle each, most of them touched; the same seed gives the same scene."""
    scenes = [contact_scene(family, seed) for seed in range(2)]
    assert all(scene["contacts"] for scene in scenes)
    assert scenes == [contact_scene(family, seed) for seed in range(2)]


def test_contact_is_judged(capsys):
    """A scene through the benchmark: a line for what is not right, and the table."""
    main(["contact", "--count", "1", "--first", "1", "--family", "drums"])
    table = capsys.readouterr().out.strip().splitlines()
    assert table[-1].startswith("| drums | 1 |")


@pytest.mark.parametrize("seed", [102, 217])
def test_lines_on_floors_are_where_the_chain_is(seed):
    """A heavy strip that stays flat though what presses it would buckle it without its weight, and a line that ends at
    elements at the end of its member.
    """
    table = contact_scene("floors", seed)
    step, chain = solve(Scene.from_dict(table)).last, chain_contact(table)
    for name, places in chain.members.items():
        # The error of chains is that of the finer of two, which is a third of their difference, and of depths.
        np.testing.assert_allclose(step.along(name, QUARTERS)["position"], places, atol=2.0 * chain.error)


def test_a_line_that_begins_within_a_long_element_is_seen():
    """No end of an element touches there: a place that stays for the line let the member into the floor beside it."""
    table = contact_scene("floors", 2277)
    step, chain = solve(Scene.from_dict(table)).last, chain_contact(table)
    for name, places in chain.members.items():
        # As scenes at random are judged; it was fifteen times as far from there.
        apart = np.abs(step.along(name, QUARTERS)["position"] - places).max() / chain.size
        assert apart < APART + chain.error


def test_a_fall_by_a_few_degrees_is_told():
    """The chain snaps there; what was left turns by 0.08 rad, no more than what is followed may in a step."""
    (note,) = solve(Scene.from_dict(contact_scene("floors", 116))).last.notes
    assert note.startswith("jumped")
    assert chain_contact(contact_scene("floors", 116)).snapped


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        # A line of two places of which each took the place of the other.
        ("spheres", 4048),
        # Touched in the middle and at both ends, which is no line.
        ("drums", 4056),
        # A fall of more than eighty steps.
        ("floors", 3048),
        # It snaps off what it has lain along, of which nothing touches while it falls.
        ("drums", 9150),
    ],
)
def test_scenes_at_random_that_were_lost_are_as_the_chain(family, seed):
    table = contact_scene(family, seed)
    step, chain = solve(Scene.from_dict(table)).last, chain_contact(table)
    apart = [np.abs(step.along(name, QUARTERS)["position"] - places).max() for name, places in chain.members.items()]
    # As scenes at random are judged; another state is a fifth of the size away.
    assert max(apart) < APART * chain.size + 3.0 * chain.error
    assert chain.snapped == any("jumped" in note for note in step.notes)


def test_soft_obstacles_snap_before_their_time():
    """The limit load is 1.004 by the eigenvalues of certificates, and 0.985 where the end is in by 2e-3 of the size."""
    table = contact_scene("floors", 3014)
    step, soft, hard = solve(Scene.from_dict(table)).last, chain_contact(table), chain_contact(table, widths=NARROW)
    assert soft.snapped
    assert not hard.snapped
    assert not step.notes
    assert step.position("B") == pytest.approx(hard.nodes["B"], abs=3.0 * hard.error)


def test_a_way_that_leads_close_past_a_bifurcation_says_so():
    """A path turns twice within a thousandth of the loads, to one side; load steps go on to the other one."""
    table = contact_scene("spheres", 9202)
    (note,) = solve(Scene.from_dict(table)).last.notes
    assert note.startswith("near factor 0.1")
    assert "unstable equilibrium is beside the way" in note
