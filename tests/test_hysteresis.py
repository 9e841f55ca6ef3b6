"""Sections whose laws have memory: loops of moments, steps of structures, energies, by independent ways."""

import itertools
import re

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import sfetcas
from sfetcas import Scene, SceneError
from sfetcas.mathematics.forms import Form
from sfetcas.mathematics.hysteresis import energies, lasting, updated
from sfetcas.reports import report

PLASTIC = {"type": "elastic-plastic", "moment": 1.0, "ratio": 0.2}
MOTION = {"type": "dynamic", "end": 1.0, "step": 0.005, "output": 0.05}
SUPER = {"type": "superelastic", "moment": 1.0, "unloading": 0.4, "curvature": 5.0, "ratio": 0.05}


def scene(law=PLASTIC, load=None, section=None, **more):
    """A cantilever of one metre along x, with a force or a moment at its end."""
    return Scene.from_dict(
        {
            "sections": {"s": {"EI3": 1.0, "EI2": 1.0, "GJ": 1.0, "law": law} if section is None else section},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
            "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
            "loads": {"tip": {"type": "moment", "node": "B", "value": 1.0} if load is None else load},
            "analysis": {"accuracy": 1e-8},
            **more,
        }
    )


def force(value, **more):
    return {"type": "force", "node": "B", "value": value, **more}


def steps(*factors, accuracy=1e-8, **more):
    return {"steps": list(factors), "accuracy": accuracy, **more}


class Plastic:
    """The curvature at given moments, one after the other: elastic within a range of moments that moves."""

    def __init__(self, moment=1.0, ratio=0.2, stiffness=1.0):
        self.moment, self.stiffness, self.hardening = moment, stiffness, stiffness * ratio / (1.0 - ratio)
        self.middle = 0.0

    def __call__(self, moment):
        self.middle = np.clip(self.middle, moment - self.moment, moment + self.moment)
        return moment / self.stiffness + self.middle / self.hardening


class Flag:
    """The curvature at given moments, one after the other, of a superelastic law, by the share that is transformed."""

    def __init__(self, moment=1.0, unloading=0.4, curvature=5.0, ratio=0.05, stiffness=1.0):
        self.begins, self.ends, self.stiffness = moment, unloading, stiffness
        slope = ratio * stiffness
        self.rise = (curvature - moment / stiffness) * slope
        self.length = curvature - (moment + self.rise) / stiffness
        self.share = 0.0

    def __call__(self, moment):
        self.share, _ = self.after(moment, self.share)
        return self.after(moment, self.share)[1]

    def after(self, moment, share):
        """Share that is transformed, and curvature."""
        size = np.abs(moment)
        up, down = (np.clip((size - begin) / self.rise, 0.0, 1.0) for begin in (self.begins, self.ends))
        # The other side begins untransformed.
        share = np.maximum(up, np.minimum(np.where(np.sign(moment) * share >= 0.0, np.abs(share), 0.0), down))
        return np.sign(moment) * share, moment / self.stiffness + np.sign(moment) * share * self.length


# -- the law at one place ----------------------------------------------------------------------------------

LOOPS = {
    "plastic": (PLASTIC, Plastic, [0.8, 1.0, 1.5, 0.7, 0, -0.4, -0.5, -1.5, -0.3, 0.5, 1.6]),
    "superelastic": (SUPER, Flag, [0.8, 1.0, 1.15, 1.1, 0.7, 0.55, 0.45, 0.4, 0.3, 0, -0.2, -1.0, -1.1]),
}


@pytest.mark.parametrize("dimension", ["plane", "space"])
@pytest.mark.parametrize("law", LOOPS)
def test_loops_of_a_moment(law, dimension):
    """A moment at the end that comes and goes: curvatures of the loop, whose area is what is dissipated.

    Corners of the loop are steps, so that trapezoids are exact: work of the load = stored + dissipated.
    """
    given, independent, moments = LOOPS[law]
    # Arcs are exact in the plane; in space quaternions between the nodes leave 1e-9 of the accuracy asked for.
    space = dimension == "space"
    moments = moments[::2] if space else moments
    asked = steps(*moments, accuracy=1e-5 if space else 1e-3)
    found = sfetcas.solve(scene(given, analysis=asked, dimension=dimension)).steps
    course = independent()
    curvatures = np.array([course(moment) for moment in moments])
    # In space without the corners, and without the work.
    work = np.cumsum(np.diff(curvatures, prepend=0.0) * 0.5 * (np.array(moments) + np.array([0.0, *moments[:-1]])))
    for step, moment, curvature, done in zip(found, moments, curvatures, work, strict=True):
        # The angle: in space of the quaternion.
        angle = step.angle("B") if dimension == "plane" else 2.0 * np.arctan2(*step.quaternion("B")[[3, 0]])
        # Newton's method ends at rounding of 1e-10 where a plateau is twenty times as soft as the section.
        assert angle == pytest.approx(curvature, abs=1e-6 if space else 1e-9)
        if not space:
            assert step.energy["elastic"] + step.energy["dissipated"] == pytest.approx(done, abs=1e-10)
        assert step.along("beam", 0.5)["curvature"][0, 2] == pytest.approx(curvature, abs=1e-4 if space else 1e-9)
        np.testing.assert_allclose(step.along("beam", [0.0, 0.7])["moment"][:, 2], moment, atol=1e-9)
    dissipated = [step.energy["dissipated"] for step in found]
    assert (np.diff([0.0, *dissipated]) > -1e-11).all()
    assert found[-1].table("members", "beam")["dissipated"] == pytest.approx(dissipated[-1], rel=1e-14)


def test_reports_say_what_is_dissipated(capsys):
    report(sfetcas.solve(scene(analysis=steps(2.0))), 0.0)
    printed = re.search(r"dissipated ([0-9.]+) J", capsys.readouterr().out)
    # The moment at which it yields times a curvature of (2 - 1) over the hardening; the rest hardening stores.
    assert float(printed[1]) == pytest.approx(1.0 * 4.0, rel=1e-8)


def test_work_of_a_force_is_stored_and_dissipated():
    """Loaded and unloaded, between the forces at which one more integration point begins to yield."""
    one = scene(load=force([0, -1.0]), members={"beam": {"nodes": ["A", "B"], "section": "s", "elements": 1}})

    def solved(*factors):
        return sfetcas.solve(one.replace({"members.beam.element": "SFET3", "analysis": steps(*factors)})).steps

    def bent(factor, at):
        return abs(solved(factor)[0].along("beam", at)["curvature"].ravel()[-1])

    begins = [brentq(lambda f, at=at: bent(f, at) - 1.0, 0.9, 3.4, xtol=1e-13) for at in (0.0, 0.5)]
    points, weights = np.polynomial.legendre.leggauss(10)
    ends = [0.0, *begins, 3.5, 0.0]
    parts = [0.5 * (a + b) + 0.5 * (b - a) * points for a, b in itertools.pairwise(ends)]
    found = solved(*np.concatenate([*parts[:3], ends[3:4], parts[3], ends[4:]]).tolist())
    tips = np.array([-step.position("B")[1] for step in found])
    peak, tips = tips[30], np.delete(tips, [30, 41]).reshape(4, 10)
    integrals = [0.5 * (b - a) * weights @ tip for (a, b), tip in zip(itertools.pairwise(ends), tips, strict=True)]
    for step, work in ((found[30], 3.5 * peak - sum(integrals[:3])), (found[-1], -sum(integrals))):
        # Ten points integrate what is smooth to rounding; steps are solved to 1e-12.
        assert step.energy["elastic"] + step.energy["dissipated"] == pytest.approx(work, abs=1e-10)
    assert found[-1].energy["dissipated"] > 0.3


@pytest.mark.parametrize("name", ["sliders", "superelastic"])
def test_potential_of_a_step(name):
    """Moments are the slopes of what is stored and dissipated, which is convex, and least over internal variables."""
    rng, form = np.random.default_rng(5), Form(name, 3, 2)
    material = [0.1] if name == "sliders" else [3.0, 0.4, 2.0, 0.9]
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", form.size)
    stored, dissipated = energies(form, x, p)
    potential = stored + dissipated + 0.5 * x[2] ** 2
    both = ca.Function("w", [x, p], [potential, ca.gradient(potential, x)[2], ca.hessian(potential, x)[0][2, 2]])
    after = ca.Function("z", [x, p], [updated(form, x, p), lasting(form, x, p)[2]])
    for _ in range(30):
        z, weights, places = rng.uniform(-0.9, 0.9, 2), np.array([0.4, 0.7]), np.array([1.0, 0.6])
        k, step = rng.uniform(-6.0, 6.0), 1e-6
        given = np.concatenate([material, weights, places, z])
        value, moment, slope = (float(part) for part in both([0, 0, k], given))
        high, low = (float(both([0, 0, k + sign * step], given)[0]) for sign in (1.0, -1.0))
        # Central differences of a function of size 10, with kinks of the slope.
        assert moment == pytest.approx((high - low) / (2.0 * step), abs=2e-6)
        assert slope > 0.0
        new, inelastic = (np.array(part).ravel() for part in after([0, 0, k], given))
        # The moment by hand from the internal variables, and no others give a lower sum.
        strains = places * k
        if name == "sliders":
            stress = 0.1 * strains + 0.9 * (strains - new)

            def total(other, strains=strains, z=z):
                return 0.05 * strains**2 + 0.45 * np.minimum((strains - other) ** 2, 1.0) + 0.9 * np.abs(other - z)

        else:
            stress = strains - 3.0 * new

            def total(other, strains=strains, z=z):
                kept = 0.5 * (strains - 3.0 * other) ** 2 + 0.2 * other**2 + 2.0 * np.abs(other)
                return kept + 0.9 * np.abs(other - z)

        # What lies inside its bounds by 1e-12 of them.
        assert moment == pytest.approx(weights @ (places * stress), abs=1e-10)
        assert inelastic == pytest.approx(k * (weights @ places**2) - moment, abs=1e-10)
        assert value == pytest.approx(weights @ total(new), abs=1e-10)
        for other in np.linspace(-1.0, 1.0, 41):
            if name == "superelastic" or (np.abs(strains - other) <= 1.0).all():
                assert value <= weights @ total(other * np.ones(2)) + 1e-12


def test_fibres_of_a_rectangle():
    """Fibres that yield at one stress: the moment of a rectangle, 3/2 - 1/2 (k1/k)^2 of that at which it begins."""
    law = {"type": "elastic-plastic", "stress": 1.0, "ratio": 1e-6}
    section = {"shape": "rectangle", "width": 6.0, "height": 1.0, "E": 2.0, "nu": 0.3, "law": law}
    # Moment 1 and curvature 1 where the outer fibres begin to yield; EI = 1.
    for k in (1.5, 3.0):
        moment = 1.5 - 0.5 / k**2
        # Fibres at the middles of equal parts, of which one yields in part: 2 (1/12)^2 of the plastic moment.
        bent = scene(
            law, {"type": "moment", "node": "B", "value": moment}, section, analysis=steps(1, 0, accuracy=1e-6)
        )
        peak, rest = sfetcas.solve(bent).steps
        assert peak.angle("B") == pytest.approx(k, rel=0.1)
        # Elastic unloading.
        assert peak.angle("B") - rest.angle("B") == pytest.approx(moment, rel=1e-9)


def test_round_sections_about_any_axis():
    """Fibres of a circle, and a vector of a round section: forces across in any direction, in the plane as in space."""
    for law, shape in (
        (
            {"type": "elastic-plastic", "stress": 1.0, "ratio": 0.05, "about": "both"},
            {"shape": "circle", "radius": 0.5},
        ),
        ({"type": "elastic-plastic", "moment": 0.1, "ratio": 0.05, "about": "both"}, None),
    ):
        section = {"EI3": 0.05, "EI2": 0.05, "GJ": 0.04, "law": law} if shape is None else None
        section = section or {**shape, "E": 1.0, "nu": 0.3, "law": law}
        asked = {"section": section, "analysis": steps(1, 0, accuracy=1e-3)}
        plane = sfetcas.solve(scene(law, force([0, 0.12]), dimension="plane", **asked)).steps
        space = sfetcas.solve(scene(law, force([0, 0.12]), dimension="space", **asked)).steps
        for one, other in zip(plane, space, strict=True):
            np.testing.assert_allclose(one.position("B"), other.position("B"), atol=1e-4)
            assert one.energy["dissipated"] == pytest.approx(other.energy["dissipated"], rel=1e-2)
        # Fibres of ten directions lie anew every 18 degrees; a vector has no directions.
        c, s = np.cos(np.pi / 5), np.sin(np.pi / 5)
        other = sfetcas.solve(scene(law, force([0, 0.12 * c, 0.12 * s]), **asked)).steps
        for one, turned in zip(plane, other, strict=True):
            x, y, _ = one.position("B")
            np.testing.assert_allclose(turned.position("B"), [x, y * c, y * s], atol=1e-4)


# -- structures --------------------------------------------------------------------------------------------


def shot(load, curvature, length=1.0):
    """Shape of the cantilever under a force across it by shooting: tip, and the moments along it from the tip on.

    ``curvature`` gives that at a distance from the tip and a moment.
    """

    def course(angle):
        def rates(s, y):
            return [np.cos(y[2]), np.sin(y[2]), -curvature(s, y[3]), load * np.cos(y[2])]

        way = {"rtol": 1e-9, "atol": 1e-11, "max_step": 0.01 * length, "dense_output": True}
        return solve_ivp(rates, (0, length), [0, 0, angle, 0], **way)

    angle = brentq(lambda angle: course(angle).y[2, -1], -0.1, 2.5, xtol=1e-10)
    found = course(angle)
    return found.y[:2, -1], lambda s: found.sol(s)[3]


def test_cantilever_loaded_and_unloaded():
    """A force at the end comes and goes: the shape that stays, by shooting with what each place remembers."""
    virgin = Plastic()
    tip, moment = shot(1.5, lambda s, m: m + max(abs(m) - 1.0, 0.0) * np.sign(m) / virgin.hardening)
    found = sfetcas.solve(scene(load=force([0, 1.5]), analysis=steps(1, 0, -1, 1.1, accuracy=1e-5))).steps

    def set_(s):
        return max(float(moment(s)) - 1.0, 0.0) / virgin.hardening

    left, _ = shot(0.0, lambda s, m: m + set_(s))
    # Accuracy asked for; kinks limit the shooting, whose steps do not know them, to 1e-6.
    np.testing.assert_allclose(found[0].position("B")[:2], tip, atol=1e-5)
    np.testing.assert_allclose(found[1].position("B")[:2], left, atol=1e-5)
    # As Masing said: the other way round twice the range, so the same shape on the other side.
    np.testing.assert_allclose(found[2].position("B") * [1, -1, 1], found[0].position("B"), atol=1e-5)
    # Beyond the first turning point the loop is forgotten.
    straight = sfetcas.solve(scene(load=force([0, 1.65]), analysis=steps(1, accuracy=1e-5))).last
    np.testing.assert_allclose(found[3].position("B"), straight.position("B"), atol=1e-5)


def test_wire_of_the_gallery():
    """The values of the problem file, by shooting."""
    known = sfetcas.load("problems/superelastic_wire_cycle.toml")
    flag = Flag(0.06, 0.025, 100.0, 0.05, 3.44e-3)
    tip, moment = shot(1.3, lambda s, m: float(flag.after(m, 0.0)[1]), 0.1)

    def share(s):
        return flag.after(moment(s), 0.0)[0]

    back, _ = shot(0.52, lambda s, m: float(flag.after(m, share(s))[1]), 0.1)
    lost = quad(lambda s: float(share(s)), 0.0, 0.1, limit=200)[0] * flag.length * (0.06 - 0.025)
    values = {(e.quantity, e.step): e.value for e in known.expect}
    # Digits of the file.
    np.testing.assert_allclose(values["nodes.tip.position", 1.0], tip, atol=1e-6)
    np.testing.assert_allclose(values["nodes.tip.position", 1.6], back, atol=1e-6)
    assert values["energy.dissipated", None] == pytest.approx(lost, rel=1e-3)


@pytest.mark.parametrize("law", [PLASTIC, SUPER], ids=["plastic", "superelastic"])
def test_motion(law):
    """A sudden force: what it does is motion, stored and dissipated; three integrators see the same."""
    section = {"EI3": 1.0, "rhoA": 1.0, "law": law}
    member = {"beam": {"nodes": ["A", "B"], "section": "s", "elements": 4}}
    found = []
    for integrator in ("radau-3", "radau-2", "generalised-alpha"):
        asked = {"analysis": {**MOTION, "integrator": integrator}, "members": member}
        motion = sfetcas.solve(scene(law, force([0, 1.2]), section, **asked))
        parts = [step.energy for step in motion.steps]
        balance = np.array([e["kinetic"] + e["elastic"] + e["dissipated"] + e["loads"] for e in parts])
        # In steps of 5 ms integrators leave up to 4e-4 J of 0.5 and 0.75 J, half of that of steps of 10 ms.
        assert np.abs(balance).max() < 1e-3
        dissipated = np.array([e["dissipated"] for e in parts])
        assert dissipated[-1] > 0.15
        assert (np.diff(dissipated) > -1e-9).all()
        found.append((motion.last.position("B"), dissipated[-1]))
    for position, dissipated in found[1:]:
        np.testing.assert_allclose(position, found[0][0], atol=2e-3)
        assert dissipated == pytest.approx(found[0][1], rel=5e-3)


# -- what is not accepted ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"analysis": steps(1, 0, 1)}, "analysis.steps: found 1 twice"),
        (
            {"analysis.type": "modes", "sections.s.rhoA": 1.0},
            "analysis.type: found 'modes', accepted: 'static', 'path' or 'dynamic'",
        ),
        ({"analysis.equilibria": "all"}, "analysis.equilibria: found 'all', accepted: 'one' with the law"),
        ({"rotating": [0, 0, 1], "sections.s.rhoA": 1.0}, "rotating: found rotating axes"),
        (
            {"sections.s.rhoA": 1.0, "analysis": {"type": "dynamic", "end": 1.0, "integrator": "idas"}},
            "integrator: found 'idas', accepted",
        ),
        ({"sections.s.rhoA": 1.0, "analysis": {**MOTION, "integrator": "conserving"}}, "found 'conserving', accepted"),
        ({"sections.s.rhoA": 1.0, "analysis": {**MOTION, "initial": "equilibrium"}}, "found 'equilibrium', accepted"),
        ({"contacts.floor": {"type": "plane", "point": [0, -1], "normal": [0, 1], "members": "all"}}, "contacts"),
        ({"springs.k": {"node": "A", "stiffness": 2.0, "stop": [-0.1, 0.1]}}, "springs.k.stop: found a stop"),
        ({"sections.s.law": {**PLASTIC, "ratio": 1.0}}, "ratio: found 1, accepted: from 1e-06 on, and below 1"),
        ({"sections.s.law": {**PLASTIC, "stress": 1.0}}, "found 'moment' and 'stress', accepted: one of them"),
        ({"sections.s.law": {**SUPER, "curvature": 0.9}}, "curvature: found 0.9, 0.9 times that at which"),
        ({"sections.s.law": {**SUPER, "unloading": 1.5}}, "unloading: found 1.5 beside a moment of 1"),
        ({"sections.s.law": {**SUPER, "about": "both"}}, "about: found 'both' with 'moment'"),
        ({"sections.s.law": {**SUPER, "strain": 0.1}}, "found 'strain' beside 'moment', accepted: 'curvature'"),
    ],
)
def test_refused_scenes(changes, message):
    with pytest.raises(SceneError) as error:
        scene().replace(changes)
    assert message in str(error.value)


@pytest.mark.parametrize(
    "call",
    [
        lambda s: sfetcas.parametric(s, ["loads.tip.value"], ["nodes.B.position"]),
        lambda s: sfetcas.changed(s, {}),
        lambda s: sfetcas.export(s, "never", arguments=["loads.tip.value"]),
        lambda s: sfetcas.solve_model(sfetcas.solve(s).last.model),
        lambda s: sfetcas.assemble(s, sfetcas.first_mesh(s, 4)),
        lambda s: sfetcas.fit(s, {}, []),
        lambda s: sfetcas.Design(s),
    ],
    ids=["parametric", "changed", "export", "solve_model", "assemble", "fit", "design"],
)
def test_what_knows_no_steps(call):
    with pytest.raises(
        SceneError, match=r"sections.s.law: found 'elastic-plastic', .* knows no steps, accepted: solve"
    ):
        call(scene(analysis=steps(1, accuracy=1e-4)))


def test_loads_turn_at_steps():
    """Where a history turns between two steps what it goes through would be left out."""
    wave = {"t": [0, 1, 2], "value": [0, 1, 0]}
    asked = {"load": force([0, 1.0], history="wave"), "histories": {"wave": wave}}
    with pytest.raises(SceneError, match=r"steps: found none between 0.5 and 1.5, where the history 'wave' turns"):
        scene(**asked, analysis=steps(0.5, 1.5))
    # Smooth ones that turn at a step, and ones that rest, are accepted.
    scene(**asked, analysis=steps(1, 2, 3))
    smooth = {"t": [0, 2, 4], "value": [0, 1, 0], "interpolation": "spline"}
    scene(**{**asked, "histories": {"wave": smooth}}, analysis=steps(1, 2, 4))


def test_errors_are_told():
    """Plastic hinges of a portal, by their amount next to nothing of the size: the error is below what is told."""
    portal = sfetcas.load("problems/portal_plastic_hinges.toml")
    fine = sfetcas.solve(portal, accuracy=1e-6).steps
    coarse = sfetcas.solve(portal, accuracy=1e-4).steps
    for one, other in zip(coarse, fine, strict=True):
        error = np.abs(one.position("B") - other.position("B")).max() / portal.size
        assert error < one.certificate.error_estimate <= 1e-4


def test_errors_of_motions_are_told():
    """Fronts leave no order by which the difference of two runs could be divided."""
    law = {"type": "elastic-plastic", "moment": 0.6, "ratio": 0.1}
    section = {"EI3": 1.0, "rhoA": 1.0, "law": law}
    wave = {"h": {"t": [0, 0.5, 1.5], "value": [0, 1, -1]}}
    task = {"type": "dynamic", "end": 1.5, "output": 0.25}
    table = scene(law, force([0, 1.0], history="h"), section, histories=wave, analysis=task)
    found, fine = sfetcas.solve(table, accuracy=1e-3), sfetcas.solve(table, accuracy=5e-4, elements=16)
    error = max(np.abs(a.position("B") - b.position("B")).max() for a, b in zip(found.steps, fine.steps, strict=True))
    assert 5e-4 < error < found.error_estimate < 1e-3


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("ratio", 1e-30, "from 1e-06 on"),
        ("moment", 1e160, "from 1e-100 to 1e\\+100"),
        ("moment", 1e-300, "from 1e-100"),
    ],
)
def test_numbers_of_which_rounding_leaves_nothing_are_refused(key, value, words):
    with pytest.raises(SceneError, match=words):
        scene({**PLASTIC, key: value})
