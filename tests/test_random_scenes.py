"""Random structures: solved and certified, or refused with a sentence; never anything else."""

import numpy as np
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st
from scenes import SOFT, UNLIKE, arc_across, made

import sfetcas
from sfetcas import SceneError, SolveError, Status

SUPPORTS = [{"support": "clamped"}, {"support": "ball"}, {"support": "hinge"}]
FORCES = [0.01, 1.0, 8.0, 60.0]


@st.composite
def structures(draw, space):
    """A tree of members on random nodes, sometimes closed to loops, on random supports, under random loads."""
    count = draw(st.integers(2, 5))
    seed = draw(st.integers(0, 10_000))
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, size=(count, 3)) * [1, 1, 1 if space else 0]
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2) + 9 * np.eye(count)
    assume(gaps.min() > 0.15)
    nodes = {f"n{i}": {"position": p.tolist()} for i, p in enumerate(points)}
    nodes["n0"]["support"] = draw(st.sampled_from(["clamped", "clamped", "ball", "hinge"]))
    pairs = [(draw(st.integers(0, i - 1)), i) for i in range(1, count)]
    if draw(st.booleans()) and count > 2:
        pairs.append((0, count - 1) if (0, count - 1) not in pairs else (1, count - 1))
    pairs = [p for p in dict.fromkeys(pairs) if p[0] != p[1]]
    if draw(st.booleans()):
        last = nodes[f"n{count - 1}"]
        kind = draw(st.sampled_from(["clamped", "ball", "slider"]))
        last["support"] = kind
        if kind == "slider":
            last |= {"direction": rng.normal(size=3).tolist() if space else [*rng.normal(size=2).tolist(), 0.0]}
            last["rotation"] = draw(st.sampled_from(["fixed", "ball"]))
    members = {}
    for number, (a, b) in enumerate(pairs):
        member = {"nodes": [f"n{a}", f"n{b}"], "section": draw(st.sampled_from(["soft", "unlike"]))}
        if draw(st.booleans()):
            across = rng.normal(size=3) if space else np.eye(3)[2]
            member["shape"] = arc_across(points[a], points[b], float(rng.uniform(-2.5, 2.5)), across)
        if draw(st.integers(0, 4)) == 0:
            member["release"] = ["rigid", draw(st.sampled_from(["hinge", "ball"]))]
        members[f"m{number}"] = member
    size = draw(st.sampled_from(FORCES))
    direction = rng.normal(size=3) * [1, 1, 1 if space else 0]
    loads = {"f": {"type": "force", "node": f"n{count - 1}", "value": (size * direction).tolist()}}
    if draw(st.booleans()):
        value = (rng.normal(size=3) * [1, 1, 1 if space else 0]).tolist()
        loads["q"] = {"type": "distributed", "member": "m0", "value": value}
    table = {
        "dimension": "space" if space else "plane",
        "sections": {"soft": {**SOFT}, "unlike": {**UNLIKE}},
        "nodes": nodes,
        "members": members,
        "loads": loads,
    }
    if draw(st.booleans()):
        vector = rng.uniform(-0.2, 0.2, size=3) * [1, 1, 1 if space else 0]
        table["motions"] = {"m": {"node": "n0", "displacement": vector.tolist()}}
    if draw(st.booleans()):
        table["gravity"] = [0.0, -3.0, 0.0]
    return table


def certified(table):
    """True where it was solved; every answer is in balance, every refusal a sentence."""
    try:
        solution = sfetcas.solve(made(table))
    except (SceneError, SolveError) as error:
        refusal = error
    else:
        refusal = None
    if refusal is not None:
        assert len(str(refusal)) > 20
        assert getattr(refusal, "status", None) is not Status.SOLVED
        return False
    step = solution.last
    certificate = step.certificate
    assert certificate.residual < 1e-9
    assert certificate.stable is not False
    assert certificate.error_estimate <= 1e-4
    force, largest = np.zeros(3), 1.0
    scene = step.model.scene
    for load in scene.loads.values():
        length = scene.center_lines[load.member].length if load.type == "distributed" else 1.0
        force += length * np.asarray(load.vector)
    for name, member in scene.members.items():
        if scene.gravity is not None:
            mass = scene.sections[member.section].mass([0.5])[0] * scene.center_lines[name].length
            force += mass * np.asarray(scene.gravity)
        ends = step.along(name, [0.0, 1.0])["position"]
        np.testing.assert_allclose(ends, [step.position(n) for n in member.nodes], atol=1e-8)
    for name, node in scene.nodes.items():
        if node.support == "free":
            continue
        reaction = step.reaction(name)[0]
        force, largest = force + reaction, max(largest, np.abs(reaction).max())
        if node.support != "slider":
            moved = next((m.displacement for m in scene.motions.values() if m.node == name), (0, 0, 0))
            np.testing.assert_allclose(step.position(name), np.add(node.position, moved), atol=1e-8)
    # The residual is below 1e-9 of the largest force or moment; lengths of order one turn one into the other.
    np.testing.assert_allclose(force, 0.0, atol=1e-8 * largest)
    return True


TALLY = {"solved": 0, "refused": 0}
FEW = settings(
    max_examples=25,
    derandomize=True,
    deadline=None,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large],
)


@FEW
@given(structures(space=False))
def test_plane(table):
    TALLY["solved" if certified(table) else "refused"] += 1


@FEW
@given(structures(space=True))
def test_space(table):
    TALLY["solved" if certified(table) else "refused"] += 1


def test_most_were_solved():
    """Refusing everything would pass the tests above."""
    if sum(TALLY.values()) == 0:
        test_plane()
    assert TALLY["solved"] > 2 * TALLY["refused"]
