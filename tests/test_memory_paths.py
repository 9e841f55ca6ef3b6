"""Paths of structures whose laws have memory: through limit points, by independent ways and by what must not matter."""

import json
from math import cos, sin

import numpy as np
import pytest
from scipy.optimize import brentq

import sfetcas
from sfetcas import Scene, SceneError, Status
from sfetcas.equilibria.settings import Settings
from sfetcas.mechanics.memory import Remembering
from sfetcas.paths import paths
from sfetcas.solvers import arclength, tracing

LEAN, YIELD, RATIO = 0.05, 0.3, 0.05
"""Of a column: force across over that along; moment at which it begins to yield; stiffness beyond, over that before."""

SUPER = {"type": "superelastic", "moment": 1.0, "unloading": 0.4, "curvature": 5.0, "ratio": 0.05}


def column(elements=16, law=None, load=None, **more):
    """A clamped column of one metre along y, pushed down and a little aside at its top."""
    law = law or {"type": "elastic-plastic", "moment": YIELD, "ratio": RATIO}
    analysis = {"type": "path", "range": [0, 1.85], "accuracy": 1e-5, **more.pop("analysis", {})}
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "EI2": 1.0, "GJ": 0.8, "law": law}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [0, 1]}},
            "members": {"c": {"nodes": ["A", "B"], "section": "s", "elements": elements}},
            "loads": {"p": {"type": "force", "node": "B", "value": [LEAN, -1], **(load or {})}},
            "analysis": analysis,
            **more,
        }
    )


@pytest.fixture(scope="module")
def collapse():
    """Through the limit point, down while places unload, and up again."""
    return sfetcas.solve(column(24, analysis={"steps": [1.5, 0.8], "points": 70}))


class Shot:
    """The column from its top on by the method of Runge and Kutta: each place remembers how far it has slid."""

    def __init__(self, n=100):
        self.n, self.hardening, self.middle = n, RATIO / (1.0 - RATIO), [0.0] * (2 * n + 1)

    def course(self, angle, load):
        """Angle at the foot, place of the top beside and above it, and moments at both ends and middles of steps."""
        h, way = 1.0 / self.n, []

        def rates(i, phi, m):
            slid = min(max(self.middle[i], m - YIELD), m + YIELD)
            return -m - slid / self.hardening, load * (sin(phi) + LEAN * cos(phi)), sin(phi), cos(phi)

        now, moments = (angle, 0.0, 0.0, 0.0), [0.0]
        for i in range(self.n):
            a = rates(2 * i, now[0], now[1])
            b = rates(2 * i + 1, now[0] + 0.5 * h * a[0], now[1] + 0.5 * h * a[1])
            c = rates(2 * i + 1, now[0] + 0.5 * h * b[0], now[1] + 0.5 * h * b[1])
            d = rates(2 * i + 2, now[0] + h * c[0], now[1] + h * c[1])
            middle = now[1] + 0.25 * h * (a[1] + b[1])
            now = tuple(x + h / 6.0 * (p + 2 * q + 2 * r + s) for x, p, q, r, s in zip(now, a, b, c, d, strict=True))
            moments += [middle, now[1]]
        way = now[2:]
        return now[0], way, moments

    def load(self, angle, near):
        return brentq(lambda load: self.course(angle, load)[0], 0.3 * near, 2.0 * near, xtol=1e-11)

    def down_to(self, target, steps=30):
        """The top where the load has fallen to a value, by growing angles, and what has been dissipated till then."""
        load, before, largest = 0.8, 0.0, 0.0
        for angle in np.linspace(0.0, 1.4, steps + 1)[1:]:
            load = self.load(angle, load)
            largest = max(largest, load)
            if load < target < largest:
                angle = brentq(lambda there: self.load(there, target) - target, before, angle, xtol=1e-9)
                _, top, moments = self.course(angle, target)
                self.slide(moments)
                slid = np.abs(self.middle) / self.hardening
                return top, YIELD * float(slid.sum() - 0.5 * (slid[0] + slid[-1])) / (2 * self.n)
            self.slide(self.course(angle, load)[2])
            before = angle
        raise AssertionError

    def slide(self, moments):
        """Remember a step; how far places have slid only grows."""
        self.middle = [min(max(z, m - YIELD), m + YIELD) for z, m in zip(self.middle, moments, strict=True)]


# -- against independent ways ------------------------------------------------------------------------------


def test_column_beyond_its_limit_load_by_shooting(collapse):
    for factor in (1.5, 0.8):
        met = [step for step in collapse.steps if step.factor == factor]
        # The second crossing of a factor is on the way down.  The shooting leaves 4e-7, as half its steps show.
        error = met[1].certificate.error_estimate
        assert error < 1e-3
        np.testing.assert_allclose(met[1].position("B")[:2], Shot().down_to(factor)[0], atol=error + 4e-7)
        assert met[1].certificate.stable is False
        assert met[1].energy["dissipated"] > 0.01
    # Until then all places load: the largest load at any angle is that of a bilinear law.
    virgin = Shot()
    loads = [virgin.load(angle, 1.8) for angle in (0.1770, 0.1782, 0.1794)]
    a, b, c = loads
    peak = b + 0.125 * (c - a) ** 2 / (2.0 * b - a - c)
    # What fronts within 40 elements leave, as the answer says.
    limit = collapse.limit_points[0]
    assert limit.factor == pytest.approx(peak, rel=limit.certificate.error_estimate)
    assert limit.certificate.error_estimate < 1e-3


def test_rod_of_the_gallery():
    """The values of the problem file, which is the column with other units."""
    known = {(e.quantity, e.step): e.value for e in sfetcas.load("problems/rod_bent_beyond_yield.toml").expect}
    for factor in (1.5, 1.2):
        top, spent = Shot().down_to(factor)
        # Digits of the file.
        np.testing.assert_allclose(known["nodes.top.position", factor][:2], top, atol=1e-6)
    assert known["energy.dissipated", 1.2] == pytest.approx(100.0 * spent, abs=1e-3)


def test_work_is_stored_or_dissipated(collapse):
    """Along the whole path, on which places load and unload."""
    count = len(collapse.points) - (len(collapse.points) - 1) % 2
    load = np.array([[LEAN, -1.0, 0.0]]) * collapse.main.factors[:count, None]
    moved = collapse.positions("B")[:count]

    def work(every):
        force, way = load[::every], moved[::every]
        return 0.5 * float(((force[1:] + force[:-1]) * np.diff(way, axis=0)).sum())

    last = collapse.points[count - 1]
    held = last.prepared.equations.at(last.state, last.loading).strain * collapse.model.scales.moment
    spent = sum(collapse.fields(last).dissipated.values())
    # Trapezoids of all steps leave about a third of what they differ by from those of every second.
    fine, coarse = work(1), work(2)
    assert held + spent == pytest.approx(fine, abs=0.5 * abs(fine - coarse))
    assert abs(fine - coarse) < 0.02 * spent
    assert spent > held


@pytest.mark.parametrize(
    ("law", "dimension"),
    [(None, "plane"), (None, "space"), ({**SUPER, "moment": 0.3, "unloading": 0.1}, "plane")],
    ids=["plastic", "plastic in space", "superelastic"],
)
def test_to_and_fro_as_load_steps(law, dimension):
    """Where moments only rise or only fall from knot to knot, steps are exact: the same on the same mesh."""
    wave = {"histories": {"wave": {"t": [0, 1, 2, 3], "value": [0, 1.5, -0.7, 1.4]}}, "dimension": dimension}
    factors = [1.0, 1.4, 2.0, 3.0]
    push = {"value": [0.6, 0], "history": "wave"}
    path = sfetcas.solve(column(4, law, push, analysis={"steps": factors, "range": [0, 3]}, **wave))
    asked = column(4, law, push, **wave).replace({"analysis": {"steps": factors, "accuracy": 1e-5}})
    for one, other in zip(path.steps, sfetcas.solve(asked).steps, strict=True):
        # Newton's method leaves 1e-10 in each of some thirty points that the next remembers.
        np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-8)
        assert one.energy["dissipated"] == pytest.approx(other.energy["dissipated"], abs=1e-8)
        assert one.energy["dissipated"] > 0.0


def test_plane_in_any_plane_of_space():
    """A round section bends about any axis: the plane column and one pushed aside obliquely, beyond the limit load."""
    law = {"type": "elastic-plastic", "moment": YIELD, "ratio": RATIO, "about": "both"}
    asked = {"points": 45, "accuracy": 1e-3}
    flat = sfetcas.solve(column(3, law, analysis=asked))
    c, s = np.cos(0.7), np.sin(0.7)
    round_ = sfetcas.solve(column(3, law, {"value": [LEAN * c, -1, LEAN * s]}, dimension="space", analysis=asked))
    one, other = flat.limit_points[0], round_.limit_points[0]
    # Both are located to 1e-7 of the length; elements in space interpolate quaternions.
    assert one.factor == pytest.approx(other.factor, rel=1e-5)
    x, y, _ = one.position("B")
    np.testing.assert_allclose(other.position("B"), [x * c, y, x * s], atol=2e-4)
    assert other.energy["dissipated"] == pytest.approx(one.energy["dissipated"], abs=1e-4)


# -- what must not matter ----------------------------------------------------------------------------------


def test_steps_along_the_path_do_not_matter(monkeypatch):
    """Half the steps lead to the same values, to the accuracy, also where places unload within them."""

    def traced():
        run = paths.PathTracing(column(8, analysis={"accuracy": 1e-4, "steps": [0.7, 1.5]}), Settings())
        return run._level(run._first_mesh()).stretches[0]

    usual = traced()
    for name in ("STRIDE", "TURNING", "FIRST"):
        monkeypatch.setattr(tracing, name, 0.5 * getattr(tracing, name))
    monkeypatch.setattr(tracing, "SHARE", 2 * tracing.SHARE)
    shorter = traced()
    assert len(shorter.traced.points) > 1.4 * len(usual.traced.points)
    for kind in ("limit", "step"):
        ours, theirs = ([*one.of_kind("limit")] if kind == "limit" else one.crossings for one in (usual, shorter))
        assert len(ours) == len(theirs) == (2 if kind == "limit" else 6)
        for one, other in zip(ours, theirs, strict=True):
            assert one.factor == pytest.approx(other.factor, rel=1e-4)
            if kind == "limit":
                # Beside it states differ much at nearly the same load.
                continue
            np.testing.assert_allclose(one.fields.position("B"), other.fields.position("B"), atol=1e-4)
    assert usual.traced.missed < 1e-4


def test_what_a_step_leaves_out():
    """Bent to twice the curvature at which it yields, and back: one step to the end knows nothing of the way."""
    law = {"type": "elastic-plastic", "moment": 1.0, "ratio": 0.2}
    scene = column(3, law, analysis={"accuracy": 1e-3})
    run = paths.PathTracing(scene, Settings())
    memory = Remembering(run._prepared(run._first_mesh()).model)
    ends = np.zeros((len(memory.model.rotations.kind), 1))
    element = memory.model.element
    for i, turns in enumerate(memory.model.rotations.turns):
        ends[turns, 0] = (i + np.array(element.nodes)) / len(memory.model.rotations.turns)
    bent = {curvature: (curvature * ends, np.zeros(0)) for curvature in (1.2, 1.6, 2.0)}
    # Slid by the curvature less 1; the inelastic part of that is 0.8.
    assert memory.missed([bent[2.0], bent[1.2]]) == pytest.approx(0.8 * (1.0 - 0.2), rel=1e-9)
    # Further on there is nothing that one step leaves out.
    assert memory.missed([bent[1.2], bent[1.6], bent[2.0]]) == pytest.approx(0.0, abs=1e-11)


def test_corners_where_some_places_yield_and_others_unload():
    """Two elements make one hinge of a point: the path turns back sharply there, and is followed through."""
    path = sfetcas.solve(column(2, analysis={"points": 60}))
    assert path.main.end.endswith("points")
    first = path.limit_points[0].factor
    near = [point for point in path.points if abs(point.factor - first) < 1e-5 * first]
    after = path.points[path.points.index(near[-1]) + 1]
    assert (near[-1].negative, after.negative, after.factor < first) == (0, 1, True)
    for point in path.points:
        found = (point.prepared or path.prepared).equations.at(point.state, point.loading)
        # What steps converge to.
        assert (np.abs(found.residual) / found.scale).max() < 2e-10
    spent = [sum(path.fields(point).dissipated.values()) for point in path.points]
    # Rounding of the internal variables.
    assert min(np.diff(spent)) > -1e-11
    assert spent[-1] > 0.01


# -- what is told, and refused -----------------------------------------------------------------------------


def test_answers_tell_what_is_dissipated(collapse):
    found = json.loads(json.dumps(collapse.to_dict()))
    spent = found["path"]["dissipated"]
    assert len(spent) == len(collapse.points)
    last = collapse.configuration(collapse.points[-1])
    assert spent[-1] == pytest.approx(last.table("members", "c")["dissipated"], rel=1e-14)
    assert found["limit_points"][0]["energy"]["dissipated"] > 0.0
    assert any("goes on to do so" in note for note in collapse.notes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"analysis.branches": 1}, "analysis.branches: found 1, accepted: 0 with the law 'elastic-plastic'"),
        ({"analysis.modes": 2, "sections.s.rhoA": 1.0}, "analysis.modes: found 2, accepted: none on a path with"),
        (
            {"sections.s.EA": 1e4},
            "analysis.type: found 'path' with the law 'elastic-plastic', which has memory, of a section",
        ),
        ({"contacts.floor": {"type": "plane", "point": [0, -1], "normal": [0, 1], "members": "all"}}, "contacts"),
    ],
)
def test_refused_scenes(changes, message):
    with pytest.raises(SceneError) as error:
        column().replace(changes)
    assert message in str(error.value)


def test_branches_are_not_followed(collapse):
    with pytest.raises(SceneError, match=r"no branch of a path is followed"):
        sfetcas.switch(collapse)


def test_without_starts_around_it_a_corner_ends_the_path(monkeypatch):
    """What the search beside corners is for; the answer says that it was not followed."""
    monkeypatch.setattr(arclength.Curve, "around", lambda curve, now, length: None)
    path = sfetcas.solve(column(2, analysis={"points": 45}))
    assert path.status is Status.CUT
    assert "could not be followed beyond factor 1.83" in path.main.end


def test_sway_of_a_portal_on_plastic_hinges():
    """Four hinges between nearly rigid members: moments by how far they have turned, balance of the swayed frame."""
    stiff, ratio, down = 3000.0, 1e-4, 3.0
    aside = {"type": "force", "value": [0.5, -0.5 * down]}
    scene = Scene.from_dict(
        {
            "sections": {"s": {"EI3": stiff, "law": {"type": "elastic-plastic", "moment": 1.0, "ratio": ratio}}},
            "nodes": {
                "A": {"position": [0, 0], "support": "clamped"},
                "B": {"position": [0, 1]},
                "C": {"position": [1, 1]},
                "D": {"position": [1, 0], "support": "clamped"},
            },
            "members": {
                name: {"nodes": nodes, "section": "s", "elements": 8}
                for name, nodes in (("left", ["A", "B"]), ("beam", ["B", "C"]), ("right", ["D", "C"]))
            },
            "loads": {"b": {**aside, "node": "B"}, "c": {**aside, "node": "C"}},
            "analysis": {"type": "path", "range": [0, 6], "accuracy": 1e-2, "points": 110},
        }
    )
    run = paths.PathTracing(scene, Settings())
    traced = run._level(run._first_mesh()).stretches[0].traced
    last, soft = traced.points[-1], stiff * ratio
    sway = float(last.fields.position("B")[0])
    assert sway > 0.1
    # Moments are linear along members; where they are above 1 the curvature is that over the hardening stiffness.
    foot = corner = 1.5
    for _ in range(60):
        turned = np.arcsin(sway)
        foot = 1.0 + np.sqrt(2.0 * (foot + corner) * turned * soft)
        corner = 1.0 + np.sqrt(2.0 * turned * soft / (1.0 / (foot + corner) + 1.0 / (2.0 * corner)))
    known = 2.0 * (foot + corner) / (np.cos(turned) + down * sway)
    # Elastic bending of 1e-3 sways by a percent or two of that, and hinges have a length.
    assert last.factor == pytest.approx(known, rel=0.03)
    largest = max(point.factor for point in traced.points)
    # The rigid frame carries 4 at most; hardening adds what a turn of a hundredth asks for.
    assert last.factor < largest
    assert 4.0 < largest < 4.6


def arch(name, law, elements=6, **analysis):
    """An arch of the gallery with a law."""
    found = sfetcas.load(f"problems/{name}.toml").to_dict()
    found.pop("expect")
    found["sections"]["strip"]["law"] = law
    for member in found["members"].values():
        member["elements"] = elements
    found["analysis"] = {"type": "path", "accuracy": 1e-3, **analysis}
    return found


BENT = {"type": "elastic-plastic", "moment": 1.5, "ratio": 0.05}


def test_arch_snaps_through_and_is_let_go():
    """Down to the other side, and unloaded there: a permanent shape, and the work of the load along the whole way."""
    found = arch("arch_120_degrees_eccentric_load", BENT, range=[0, 2], steps=[1, 2])
    (load,) = found["loads"].values()
    load["value"], load["history"] = [11.0 * part for part in load["value"]], "pulse"
    found["histories"] = {"pulse": {"t": [0, 1, 2], "value": [0, 1, 0]}}
    scene = Scene.from_dict(found)
    run = paths.PathTracing(scene, Settings())
    part = run._level(run._first_mesh()).stretches[0]
    assert len(part.of_kind("limit")) == 2
    *_, down, free = part.crossings
    assert (down.factor, free.factor) == (1.0, 2.0)
    assert down.fields.position(load["node"])[1] < 0.0
    # Nothing yields when it is let go, though it stays bent.
    spent = [sum(point.fields.dissipated.values()) for point in (down, free)]
    assert spent[1] == pytest.approx(spent[0], rel=1e-6)
    unit = free.model.scales.moment
    held = free.point.strain * unit
    assert held > 0.1
    points = part.traced.points
    rise = np.interp([point.factor for point in points], [0, 1, 2], [0, 1, 0])
    force, moved = rise[:, None] * np.array(load["value"]), [p.fields.position(load["node"])[:2] for p in points]
    work = 0.5 * float(((force[1:] + force[:-1])[:, :2] * np.diff(moved, axis=0)).sum())
    # Trapezoids of a hundred steps.
    assert held + spent[1] == pytest.approx(work, rel=5e-3)


def test_symmetric_arch_has_a_bifurcation_of_its_loading_stiffness():
    """Beyond the limit load of the symmetric arch a sway is neutral; the path stays symmetric."""
    path = sfetcas.solve(Scene.from_dict(arch("arch_120_degrees_crown_load", BENT, 8, range=[0, 20], points=60)))
    limit, bifurcation = path.limit_points[0], path.bifurcations[0]
    # On fine meshes the limit load is 9.91285 and the bifurcation is at 9.2455: hinges of single points come later.
    assert limit.factor == pytest.approx(9.913, abs=0.05)
    assert 9.2 < bifurcation.factor < limit.factor
    assert (limit.certificate.stable, bifurcation.certificate.stable) != (True, True)
    assert abs(bifurcation.position("crown")[0]) < 1e-6
    sway = paths.buckling_mode(path)
    aside, down = sway.position("crown")[:2]
    assert abs(aside) > 100.0 * abs(down)
    assert path.plot().axes
