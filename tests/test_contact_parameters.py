"""Parameters and derivatives where members touch something: against differences of statics, and other touches."""

import numpy as np
import pytest
from scenes import CARRIED, CROSSING, DRUM, FLOOR, IN_PIPE, ON_DRUM, ON_FLOOR, pressed_on, weight

from sfetcas import Measurement, Scene, SceneError, SolveError, Status, fit, parametric, solve
from sfetcas.parametric.arguments import with_values


def told(scene, names):
    """Answers of statics, flat; of several places the resultant."""
    last, found = solve(scene).last, []
    for name in names:
        kind, record, key = name.split(".")
        value = np.asarray(last.table(kind, record)[key], dtype=float)
        found.append(value.reshape(-1, 3).sum(axis=0) if key == "force" else value.ravel())
    return np.concatenate(found)


SPACE = {"sections": {"s": {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8}}, "dimension": "space"}
EDGE = {"type": "point", "position": [0.6, -0.1], "side": [0, 1]}
WALL = {"type": "plane", "point": [0, 0, -0.3], "normal": [0, 0, 1]}

PLACE = ["nodes.B.position", "contacts.c.force", "contacts.c.at", "reactions.A.moment"]


@pytest.mark.parametrize(
    ("parts", "names"),
    [
        (
            pressed_on(DRUM),
            ["contacts.c.center.1", "sections.s.EI3", "nodes.B.position.0"],
        ),
        (pressed_on({**DRUM, "member_radius": 0.02}), ["contacts.c.member_radius"]),
        (pressed_on(EDGE), ["contacts.c.position", "loads.F.value"]),
        (pressed_on(FLOOR, (0.5, -2)), ["contacts.c.point", "contacts.c.normal"]),
        (pressed_on(WALL, (0.3, 0.2, -2), **SPACE), ["contacts.c.normal"]),
        (pressed_on({}, **CARRIED), ["contacts.c.radius", "contacts.c.center", "nodes.D.position"]),
        (pressed_on({}, (0.05, 0.02, -1), **SPACE, **CROSSING), ["contacts.c.radius"]),
    ],
    ids=["drum", "radius", "edge", "floor", "space", "carried", "crossing"],
)
def test_derivatives_are_those_of_statics(parts, names):
    scene = Scene.from_dict(parts)
    function = parametric(scene, names, PLACE)
    answer = function.solve()
    assert answer.stable is True
    for i, own in enumerate(np.eye(len(function.numbers))):
        value, step = function.solver.arguments.defaults, 1e-5
        ends = (with_values(scene, function.by_parameter(value + sign * step * own)) for sign in (1.0, -1.0))
        up, down = (told(each, PLACE) for each in ends)
        wanted = (up - down) / (2.0 * step)
        # Positions are known to 1e-9 or better, over twice the step; forces to ten times that.
        assert answer.flat_jacobian[:, i] == pytest.approx(wanted, rel=1e-6, abs=1e-5)


def test_second_derivatives():
    function = parametric(Scene.from_dict(pressed_on(DRUM)), ["contacts.c.radius", "loads.F.value"], PLACE)
    # Elsewhere than where an element ends at the place, where those of the mesh jump.
    here, step = function.solve({"contacts.c.radius": 0.305}), 1e-5
    ends = (function.solve({"contacts.c.radius": 0.305 + sign * step}, here) for sign in (1.0, -1.0))
    up, down = (end.flat_jacobian for end in ends)
    for i, row in enumerate((up - down) / (2.0 * step)):
        found = here.flat_hessian(np.eye(len(up))[i])[0]
        # Rounding of first derivatives, 1e-12 of what is up to 1e2, over the step.
        assert found == pytest.approx(row, rel=1e-5, abs=1e-4)


def test_section_forces_beside_a_place_within_an_element():
    scene = Scene.from_dict(pressed_on(DRUM))
    at = [0.3, 0.7, 0.79, 0.83, 0.9]
    places = {"beam": at}
    function = parametric(scene, ["loads.F.value"], ["members.beam.force", "members.beam.moment"], places=places)
    # Where it touches moves by 0.01 within its element.
    answer = function.solve({"loads.F.value": [0.0, -3.0]})
    fine = solve(answer.of.scene_at(answer.values)).last.along("beam", np.array(at))
    touches = solve(answer.of.scene_at(answer.values)).last.contacts["c"]["at"]
    assert not any(abs(touches - x) < 1e-3 for x in at)
    # As near as the mesh of other loads is, which errors() tells of positions and moments.
    for key in ("force", "moment"):
        assert answer[f"members.beam.{key}"] == pytest.approx(fine[key], abs=1e-3)


# -- along lines -------------------------------------------------------------------------------------------------


TELLS = ["nodes.B.position", "contacts.c.force", "reactions.A.moment"]


@pytest.mark.parametrize(
    ("parts", "ways"),
    [
        (ON_FLOOR, {"sections.s.EI3": 0.1, "loads.W.value.1": -3.0, "contacts.c.point.1": -0.01}),
        (ON_DRUM, {"contacts.c.radius": 0.1, "loads.F.value.1": -10.0, "sections.s.EI3": 0.5}),
        (IN_PIPE, {"contacts.c.radius": 0.1, "loads.W.value.1": -100.0}),
    ],
    ids=["floor", "drum", "pipe"],
)
def test_derivatives_along_lines_are_those_of_statics(parts, ways):
    scene, names, step = Scene.from_dict(parts), list(ways), 1e-3
    function = parametric(scene, names, TELLS)
    answer, way = function.solve(), np.array(list(ways.values()))
    assert answer.stable is True
    assert answer.of.solver.model.mesh.lies
    slope = answer.flat_jacobian @ way
    ends = [function.by_parameter(answer.numbers + sign * step * way) for sign in (1.0, -1.0)]
    up, down = (told(with_values(scene, each), TELLS) for each in ends)
    wanted = (up - down) / (2.0 * step)
    # Positions are a thousand times as accurate as was asked for, forces a hundred times; third derivatives leave 1e-6.
    assert slope == pytest.approx(wanted, rel=1e-5, abs=1e-5 * np.abs(wanted).max())
    # Elements follow the ends of the line.
    near = [function.solve(each, answer) for each in ends]
    assert all(one.of is function for one in near)
    assert np.concatenate([near[0][name] for name in TELLS]) == pytest.approx(up, abs=1e-6 * np.abs(up).max())
    curved = (near[0].flat_jacobian - near[1].flat_jacobian) @ way / (2.0 * step)
    for i in np.flatnonzero(np.abs(curved) > 1e-2 * np.abs(curved).max()):
        found = way @ answer.flat_hessian(np.eye(len(curved))[i]) @ way
        # Fourth derivatives leave 1e-5.
        assert found == pytest.approx(curved[i], rel=1e-4)


def test_section_forces_and_errors_along_a_line():
    at = [0.1, 0.3, 0.38, 0.42, 0.47, 0.55, 0.9]
    names = [f"members.beam.{key}" for key in ("position", "force", "moment")]
    answer = parametric(Scene.from_dict(ON_DRUM), ["loads.F.value"], names, places={"beam": at}).solve()
    step = answer.of.solver.answer
    assert step.contacts["c"]["at"][0] < 0.38
    assert step.contacts["c"]["at"][1] > 0.47
    fine, errors = step.along("beam", np.array(at)), answer.errors()
    for name in names:
        assert answer[name] == pytest.approx(fine[name.rpartition(".")[2]], abs=1e-8 * np.abs(answer[name]).max())
        # The accuracy that was asked for, of forces that are tens.
        assert errors[name] < 1e-5
    with pytest.raises(SolveError, match="second derivatives are not known beside answers along a member that lies"):
        answer.hessian(names[0])
    # Elements stay, so that lines that end elsewhere are found anew.
    other = answer.of.solve({"loads.F.value": [0, -31]}, answer)
    assert other.of is not answer.of
    fine = other.certified().along("beam", np.array(at))
    assert other[names[2]] == pytest.approx(fine["moment"], abs=1e-7)


def test_lines_for_other_numbers_are_found_anew():
    function = parametric(Scene.from_dict({**ON_FLOOR, "loads": weight(-3)}), ["loads.W.value"], TELLS)
    last = function.solve()
    for value in (-4.0, -60.0, -50.0):
        last = function.solve({"loads.W.value": [0, value]}, last)
        wanted = told(function.scene_at(last.values), TELLS)
        assert np.concatenate([last[name] for name in TELLS]) == pytest.approx(wanted, abs=1e-5 * np.abs(wanted).max())
        assert last.of.solver.model.mesh.lies == (value < -5.0)
    # Without line, and with two ways of lying.
    assert len(function.touching.equilibria) == 1


# -- what else touches -------------------------------------------------------------------------------------------


def two():
    parts = pressed_on({**DRUM, "center": [0.4, -0.3], "radius": 0.25}, accuracy=1e-8)
    parts["contacts"]["d"] = {"type": "circle", "center": [0.8, -0.45], "radius": 0.1, "members": "all"}
    return Scene.from_dict(parts)


def test_what_touches_is_found_anew_where_it_is_something_else():
    names = ["nodes.B.position", "contacts.c.force", "contacts.d.force"]
    function = parametric(two(), ["loads.F.value"], names)
    last, counts = function.solve(), []
    for load in ([0, -5], [0, -8], [0, 1], [0, -4]):
        last = function.solve({"loads.F.value": load}, last)
        wanted = told(function.scene_at(last.values), names)
        found = np.concatenate([last[name] for name in names])
        # Places are within elements of the mesh of the first loads: errors() says 2e-5 at the last.
        assert found == pytest.approx(wanted, abs=1e-4 * max(1.0, np.abs(wanted).max()))
        counts.append(len(last.of.solver.model.mesh.points))
        assert last.jacobian["nodes.B.position"]["loads.F.value"][1, 1] > 0.0
    assert counts == [2, 2, 0, 1]
    # Where a place has begun elsewhere along its member is known: else it takes five.
    assert last.outcome.iterations <= 4
    # The same is no other solver.
    assert len(function.touching.equilibria) == 3


def test_derivatives_where_something_touches_without_a_force():
    scene = Scene.from_dict(pressed_on({**DRUM, "center": [0.5, -0.5], "radius": 0.5}, load=(0, -1e-9)))
    answer = parametric(scene, ["loads.F.value"], ["nodes.B.position"]).solve()
    with pytest.raises(SolveError, match=r"contacts\.c touches beam at 0\.5 without a force, and derivatives") as error:
        _ = answer.flat_jacobian
    assert error.value.status is Status.KINK


def test_stiffness_is_counted_without_where_it_touches():
    """The Lagrangian is largest in where the beam touches; an arch that would snap is unstable all the same."""
    function = parametric(Scene.from_dict(pressed_on(DRUM)), ["loads.F.value"], ["compliance.B"])
    answer = function.solve()
    assert answer.outcome.negative == 0
    step = parametric(Scene.from_dict(pressed_on(DRUM)), ["loads.F.value"], ["nodes.B.position"]).solve()
    assert answer["compliance.B"][:2, :2] == pytest.approx(step.jacobian["nodes.B.position"]["loads.F.value"][:2])


def test_a_fit_in_contact_finds_the_stiffness():
    scene = Scene.from_dict(pressed_on(DRUM))
    true = with_values(scene, {"sections.s.EI3": 1.3})
    seen = Measurement("nodes.B.position", solve(true).last.position("B"), 1e-6)
    found = fit(scene, {"sections.s.EI3": (0.5, 3.0)}, [seen])
    # The mesh is that of the first stiffness.
    assert found.estimates["sections.s.EI3"] == pytest.approx(1.3, rel=1e-4)


# -- what is refused ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parts", "answers", "sentence"),
    [
        (
            pressed_on({**FLOOR, "friction": 0.3}),
            None,
            r"contacts\.c\.friction: what sticks and slides depends on the steps",
        ),
        (pressed_on(DRUM, (0, -20)), ["contacts.d.at"], r"contacts\.d\.at: found 'd', accepted: c"),
        (
            pressed_on({**FLOOR, "point": [0, -2]}),
            ["contacts.c.at"],
            "touches at 0 places, accepted: one that touches at one",
        ),
    ],
    ids=["friction", "name", "nowhere"],
)
def test_refused(parts, answers, sentence):
    with pytest.raises(SceneError, match=sentence):
        parametric(Scene.from_dict(parts), ["factor"], answers)


def test_radius_of_a_drum_on_which_a_member_begins():
    """Larger ones are refused, smaller ones are not."""
    parts = pressed_on({"type": "circle", "center": [0.4, -0.2], "radius": 0.2})
    scene = Scene.from_dict({**parts, "analysis": {"accuracy": 1e-8}})
    found = parametric(scene, ["contacts.c.radius"], ["nodes.B.position"]).solve()
    smaller = solve(scene.replace({"contacts.c.radius": 0.2 - 1e-5})).last.position("B")
    slope = found.jacobian["nodes.B.position"]["contacts.c.radius"]
    np.testing.assert_allclose((found["nodes.B.position"] - smaller) / 1e-5, np.ravel(slope), atol=2e-3)


def test_a_slider_is_not_driven_along_its_guide_by_a_vector_of_numbers():
    """The component across it is one, also by default; a vector is refused: with it the guide would be driven."""
    table = {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {
            "root": {"position": [0, 0], "support": "clamped"},
            "tip": {"position": [1, 0], "support": "slider", "direction": [1, 0], "rotation": "hinge"},
        },
        "members": {"b": {"nodes": ["root", "tip"], "section": "s"}},
        "motions": {"down": {"node": "tip", "displacement": [0, -0.1]}},
        "contacts": {"peg": {"type": "circle", "center": [0.5, -0.03], "radius": 0.02, "member": "b"}},
        "analysis": {"accuracy": 1e-8},
    }
    scene, number = Scene.from_dict(table), "motions.down.displacement.1"
    with pytest.raises(SceneError, match=rf"drive along its guide, accepted: {number}, across it"):
        parametric(scene, ["motions.down.displacement"], ["reactions.tip.force"])
    assert number in parametric(scene).solve().values
    answer = parametric(scene, [number], ["reactions.tip.force"]).solve()
    up, down = (solve(scene.replace({number: -0.1 + way})).last.reaction("tip")[0][1] for way in (1e-5, -1e-5))
    # Accuracy over the step.
    assert answer.flat_jacobian[1, 0] == pytest.approx((up - down) / 2e-5, rel=1e-4)
