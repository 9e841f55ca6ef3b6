"""Scenes for the tests of the mechanics: a zoo of small structures, and what can be done to a scene."""

import copy

import numpy as np

from sfetcas import Scene, assemble, uniform_mesh
from sfetcas.mathematics import quaternion as quat

SOFT = {"EI2": 1.0, "EI3": 1.0, "GJ": 0.8, "rhoA": 0.5}
UNLIKE = {"EI2": 3.0, "EI3": 1.0, "GJ": 0.7, "rhoA": 0.4}


def arc_across(a, b, angle, direction):
    """An arc whose normal is the part of a direction across the chord."""
    chord = np.subtract(b, a) / np.linalg.norm(np.subtract(b, a))
    normal = direction - chord * (chord @ direction)
    return {"type": "arc", "angle": angle, "normal": normal.tolist()}


def cantilever(value=(0.0, 1.0), **more):
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"tip": {"type": "force", "node": "B", "value": list(value)}},
        **more,
    }


def plane_loads():
    """Every kind of load of the plane on a bent cantilever."""
    table = cantilever((0.6, 1.3))
    table["sections"]["s"] = {**SOFT, "EI3": {"at": [0, 0.4, 1], "value": [2.0, 1.0, 0.7]}}
    table["members"]["m"]["shape"] = {"type": "arc", "angle": 0.9}
    table["gravity"] = [0.3, -1.0]
    table["loads"] |= {
        "spread": {"type": "distributed", "member": "m", "value": [0.4, -0.7], "profile": {"polynomial": [1, 2]}},
        "inside": {"type": "force", "member": "m", "at": 0.3, "value": [-1.0, 2.0]},
        "couple": {"type": "moment", "member": "m", "at": 0.6, "value": -0.8},
        "end": {"type": "moment", "node": "B", "value": 0.5},
    }
    return table


def arch():
    """Clamped arch: a loop through the ground, load beside the crown."""
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1.0, 0.2], "support": "clamped"},
        },
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": -2.0}}},
        "loads": {"down": {"type": "force", "member": "m", "at": 0.4, "value": [4.0, -30.0]}},
        "gravity": [0.0, -2.0],
    }


def four_bar():
    """Three members on two ball supports, one rigid corner and one hinge: a loop."""
    return {
        "sections": {"s": {**SOFT}, "thick": {**SOFT, "EI3": 2.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [0, 1]},
            "C": {"position": [1.2, 1.1], "joint": "hinge"},
            "D": {"position": [1.2, 0], "support": "ball"},
        },
        "members": {
            "left": {"nodes": ["A", "B"], "section": "s"},
            "top": {"nodes": ["B", "C"], "section": "thick"},
            "right": {"nodes": ["C", "D"], "section": "s"},
        },
        "loads": {
            "side": {"type": "force", "node": "B", "value": [1.5, -0.5]},
            "wind": {"type": "distributed", "member": "right", "value": [-0.8, 0.0]},
        },
    }


def guided():
    """A slider on a slanted guide, a second one that turns, and a prescribed rotation and displacement."""
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0.2], "support": "slider", "direction": [1, 0.3], "rotation": "fixed"},
            "C": {"position": [1.5, 1.0], "support": "slider", "direction": [0, 1], "rotation": "ball"},
        },
        "members": {
            "one": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": 0.7}},
            "two": {"nodes": ["B", "C"], "section": "s"},
        },
        "loads": {
            "push": {"type": "force", "node": "B", "value": [-3.0, 1.0]},
            "lift": {"type": "force", "node": "C", "value": [0.5, 2.0]},
            "twist": {"type": "moment", "node": "C", "value": 0.6},
            "idle": {"type": "moment", "node": "B", "value": -0.4},
        },
        "motions": {"turn": {"node": "A", "rotation": 0.4, "displacement": [0.05, -0.1]}},
    }


def bend_45():
    """The bend of Bathe and Bolourchi, shortened, with an unlike section and a slanted force."""
    angle, radius = np.pi / 4, 1.0
    end = [radius * np.sin(angle), radius * (1 - np.cos(angle)), 0.0]
    return {
        "sections": {"s": {**UNLIKE}},
        "nodes": {"A": {"position": [0, 0, 0], "support": "clamped"}, "B": {"position": end}},
        "members": {"m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": angle}}},
        "loads": {
            "tip": {"type": "force", "node": "B", "value": [0.5, 1.0, 4.0]},
            "spread": {"type": "distributed", "member": "m", "value": [0, 2.0, -1.0]},
            "inside": {"type": "force", "member": "m", "at": 0.5, "value": [1.0, 0.0, 1.0]},
        },
        "gravity": [0, 0, -3.0],
    }


def tripod():
    """Three members of unlike sections on a rigid node in space: two loops; one foot is turned."""
    top = [0.1, 0.0, 1.0]
    return {
        "sections": {"s": {**UNLIKE}, "t": {**SOFT}},
        "nodes": {
            "top": {"position": top},
            "a": {"position": [1, 0, 0], "support": "clamped"},
            "b": {"position": [-0.6, 0.8, 0], "support": "clamped"},
            "c": {"position": [-0.5, -0.9, 0.1], "support": "ball"},
        },
        "members": {
            "one": {"nodes": ["a", "top"], "section": "s", "shape": arc_across([1, 0, 0], top, 0.8, [0, 1, 0.2])},
            "two": {"nodes": ["top", "b"], "section": "t", "shape": arc_across(top, [-0.6, 0.8, 0], -0.9, [1, 1, 0])},
            "three": {
                "nodes": ["c", "top"],
                "section": "s",
                "shape": arc_across([-0.5, -0.9, 0.1], top, 0.5, [1, -1, 0]),
            },
        },
        "loads": {"push": {"type": "force", "node": "top", "value": [0.7, 0.4, -2.0]}},
        "motions": {"foot": {"node": "a", "rotation": [0.1, -0.2, 0.3], "displacement": [0.02, 0.0, -0.03]}},
        "gravity": [0, 0, -1.0],
    }


def hinged_space():
    """Slanted hinges in space: a support, a joint between members, a released end; and a guide."""
    return {
        "sections": {"s": {**UNLIKE}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "hinge", "axis": [0.2, 0.3, 1.0]},
            "B": {"position": [1, 0, 0.3], "joint": "hinge", "axis": [0.1, 1.0, 0.3]},
            "C": {"position": [1.5, 0.9, 0.2], "axis": [1.0, 0.2, 0.0]},
            "D": {
                "position": [0.7, 1.4, 0],
                "support": "slider",
                "direction": [1, 0.2, 0.1],
                "rotation": "hinge",
                "axis": [0, 0.3, 1],
            },
            "E": {"position": [2.2, 1.2, 0.0], "support": "clamped"},
        },
        "members": {
            "one": {"nodes": ["A", "B"], "section": "s"},
            "two": {
                "nodes": ["B", "C"],
                "section": "s",
                "shape": arc_across([1, 0, 0.3], [1.5, 0.9, 0.2], 0.7, [0.3, 0, 1]),
            },
            "three": {"nodes": ["C", "D"], "section": "s"},
            "four": {
                "nodes": ["E", "C"],
                "section": "s",
                "release": ["rigid", "hinge"],
                "shape": arc_across([2.2, 1.2, 0], [1.5, 0.9, 0.2], -0.6, [0, 0, 1]),
            },
        },
        "loads": {
            "push": {"type": "force", "node": "B", "value": [2.0, -6.0, 4.0]},
            "spread": {"type": "distributed", "member": "three", "value": [1.0, 1.5, -4.0]},
        },
    }


def helix():
    """A helix between a clamped node that is turned and a guide; twist and bending are coupled."""
    end = [0.5 * np.cos(2 * np.pi * 0.75), 0.5 * np.sin(2 * np.pi * 0.75), 0.6]
    return {
        "sections": {"s": {**UNLIKE}},
        "nodes": {
            "A": {"position": [0.5, 0, 0], "support": "clamped"},
            "B": {"position": end, "support": "slider", "direction": [0, 0, 1], "rotation": "ball"},
        },
        "members": {
            "m": {
                "nodes": ["A", "B"],
                "section": "s",
                "shape": {
                    "type": "helix",
                    "radius": 0.5,
                    "pitch": 0.8,
                    "turns": 0.75,
                    "axis": [0, 0, 1],
                    "center": [0, 0, 0],
                },
            }
        },
        "loads": {"pull": {"type": "force", "node": "B", "value": [0, 0, 1.5]}},
        "motions": {"turn": {"node": "A", "rotation": [0.2, 0.1, -0.5]}},
    }


PLANE = {f.__name__: f for f in (plane_loads, arch, four_bar, guided)}
SPACE = {f.__name__: f for f in (bend_45, tripod, hinged_space, helix)}
ZOO = {**PLANE, **SPACE}


def three_parallel_cranks(shift, force, **analysis):
    """Three upright cranks of 1 m under one coupler, a spring at the first; the last one leans by ``shift`` m."""
    ground = {name: {"position": [x, 0, 0], "support": "hinge"} for x, name in enumerate("abc")}
    coupler = {"A": [0, 1, 0], "B": [1, 1, 0], "C": [2 + shift, 1, 0]}
    cranks = {
        a + b: {"nodes": [a, b], "type": "rigid", "release": ["rigid", "hinge"]}
        for a, b in zip("abc", "ABC", strict=True)
    }
    return {
        "nodes": ground | {name: {"position": place} for name, place in coupler.items()},
        "members": cranks | {name: {"nodes": list(name), "type": "rigid"} for name in ("AB", "BC")},
        "springs": {"s": {"type": "rotational", "node": "a", "stiffness": 10.0}},
        "loads": {"f": {"type": "force", "node": "A", "value": list(force)}},
        "analysis": {"type": "static", **analysis},
    }


def made(table):
    return Scene.from_dict(copy.deepcopy(table))


def model_of(table, elements=2, order=4, **options):
    gauss = options.pop("gauss", False)
    scene = table if isinstance(table, Scene) else made(table)
    return assemble(scene, uniform_mesh(scene, order, elements, gauss), **options)


def three(vector):
    return np.array([*vector, 0.0]) if len(vector) == 2 else np.array(vector, float)


def transformed(table, turn=None, shift=(0, 0, 0), length=1.0, force=1.0):
    """The scene turned or mirrored by an orthogonal matrix, moved, and in other units of length and force.

    Axes, normals and rotation vectors are pseudovectors: a mirror turns them round once more.
    """
    turn = np.eye(3) if turn is None else np.asarray(turn)
    hand = round(np.linalg.det(turn))
    old, table = made(table), copy.deepcopy(table)
    shift = np.asarray(shift, float)

    def vector(v, factor=1.0):
        return (factor * turn @ three(v)).tolist()

    for section in table["sections"].values():
        for key, unit in (("EI2", force * length**2), ("EI3", force * length**2), ("GJ", force * length**2),
                          ("rhoA", force / length)):  # fmt: skip
            if key not in section:
                continue
            value = section[key]
            section[key] = (
                {"at": value["at"], "value": [unit * v for v in value["value"]]}
                if isinstance(value, dict)
                else unit * value
            )
    for name, node in table["nodes"].items():
        if old.nodes[name].has_hinge:
            node.setdefault("axis", [0.0, 0.0, 1.0])
        for key in ("position", "start"):
            if key in node:
                node[key] = (length * (turn @ three(node[key]) + shift)).tolist()
        if "direction" in node:
            node["direction"] = vector(node["direction"])
        for key in ("axis", "axis2"):
            if key in node:
                node[key] = vector(node[key], hand)
    for name, member in table["members"].items():
        frame = quat.matrix(old.center_lines[name].quaternions([0.0]))[0]
        member["b2"] = vector(frame[:, 1])
        shape = member.get("shape", {})
        if shape.get("type") == "arc":
            shape["normal"] = vector(shape.get("normal", [0, 0, 1]), hand)
        elif shape.get("type") == "helix":
            shape["axis"] = vector(shape["axis"], hand)
            shape["center"] = (length * (turn @ three(shape["center"]) + shift)).tolist()
            shape["pitch"] *= hand * length
            shape["radius"] *= length
        else:
            assert not shape, "only straight members, arcs and helices are transformed"
    for load in table.get("loads", {}).values():
        if load["type"] == "moment":
            size = hand * force * length
            load["value"] = size * load["value"] if np.isscalar(load["value"]) else vector(load["value"], size)
        else:
            load["value"] = vector(load["value"], force / length if load["type"] == "distributed" else force)
    for motion in table.get("motions", {}).values():
        if "displacement" in motion:
            motion["displacement"] = vector(motion["displacement"], length)
        if "rotation" in motion and not np.isscalar(motion["rotation"]):
            motion["rotation"] = vector(motion["rotation"], hand)
        elif "rotation" in motion and (
            old.resolved_dimension == "plane" or "direction" in table["nodes"][motion["node"]]
        ):
            motion["rotation"] *= hand
    for spring in table.get("springs", {}).values():
        if spring.get("type") != "translational":
            spring["stiffness"] *= force * length
            spring["axis"] = vector(spring.get("axis", [0, 0, 1]), hand)
            continue
        spring["stiffness"] *= force / length
        spring |= {key: length * spring[key] for key in ("length", "rest") if key in spring}
        if "direction" in spring:
            spring["direction"] = vector(spring["direction"])
        if "anchor" in spring:
            spring["anchor"] = (length * (turn @ three(spring["anchor"]) + shift)).tolist()
    if "gravity" in table:
        table["gravity"] = vector(table["gravity"])
    return table


def turned_about(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return quat.matrix(quat.from_rotation_vector(angle * axis))


def gauss_points(breaks, n=12):
    """Gauss points and weights on the stretches between breaks."""
    x, w = np.polynomial.legendre.leggauss(n)
    breaks = np.asarray(breaks)
    h = np.diff(breaks)
    return (breaks[:-1, None] + 0.5 * h[:, None] * (x + 1)).ravel(), (0.5 * h[:, None] * w).ravel()


def density(scene, name, x):
    """Force per length (n, 3) along a member, from the scene alone."""
    total = np.zeros((len(x), 3))
    for load in scene.loads.values():
        if load.type == "distributed" and load.member == name:
            profile = np.ones(len(x))
            if load.profile is not None and not isinstance(load.profile, float):
                profile = np.polynomial.polynomial.polyval(x, load.profile.polynomial)
            total += profile[:, None] * np.asarray(load.vector)
    if scene.gravity is not None and scene.members[name].section is not None:
        total += scene.sections[scene.members[name].section].mass(x)[:, None] * np.asarray(scene.gravity)
    return total


def elastica(alpha):
    """Tip (x, y) of a cantilever of unit length under a dead force across it, F L^2/EI = alpha.

    The pendulum analogy: 1 + sin theta = 2 k^2 sin^2 phi with k^2 = (1 + sin theta_tip)/2 gives
    sqrt(alpha) ds = dphi / sqrt(1 - k^2 sin^2 phi).  Above alpha = 2000 the tip stands upright to 1e-18.
    """
    if alpha > 2000.0:
        return np.array([np.sqrt(2.0 / alpha), 1.0 - (2.0 - np.sqrt(2.0)) / np.sqrt(alpha)])
    x, w = np.polynomial.legendre.leggauss(100)

    def integrals(log_kc):
        # sin psi = kc sinh(u) / k with psi = pi/2 - phi makes the integrand smooth also for k near 1.
        kc2 = np.exp(2.0 * log_kc)
        k2 = 1.0 - kc2
        top = np.arcsinh(np.sqrt((k2 - 0.5) / kc2))
        u = 0.5 * top * (x + 1.0)
        du = 0.5 * top * w / np.sqrt(k2 - kc2 * np.sinh(u) ** 2)
        return du.sum(), (2.0 * kc2 * np.cosh(u) ** 2 * du).sum(), 1.0 - 2.0 * kc2

    low, high = -60.0, np.log(np.sqrt(0.5))
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if integrals(middle)[0] > np.sqrt(alpha) else (low, middle)
    length, lack, sine = integrals(0.5 * (low + high))
    return np.array([np.sqrt(2.0 * sine / alpha), 1.0 - lack / length])


def textbook(length, ea, gj, ei2, ei3):
    """The 12 x 12 stiffness of a straight Euler-Bernoulli beam along b1, three places, three rotations each end."""
    k, n = np.zeros((12, 12)), length
    for i, stiffness in ((0, ea / n), (3, gj / n)):
        k[np.ix_([i, i + 6], [i, i + 6])] = stiffness * np.array([[1, -1], [-1, 1]])
    for ei, place, turn, sign in ((ei3, 1, 5, 1.0), (ei2, 2, 4, -1.0)):
        c = np.array([[12, 6 * n, -12, 6 * n], [6 * n, 4 * n**2, -6 * n, 2 * n**2],
                      [-12, -6 * n, 12, -6 * n], [6 * n, 2 * n**2, -6 * n, 4 * n**2]]) * ei / n**3  # fmt: skip
        s = np.diag([1, sign, 1, sign])
        index = [place, turn, place + 6, turn + 6]
        k[np.ix_(index, index)] = s @ c @ s
    return k


CARRIED = {
    "nodes": {
        "A": {"position": [0, 0], "support": "clamped"},
        "B": {"position": [1, 0]},
        "C": {"position": [0.6, -1], "support": "clamped"},
        "D": {"position": [0.6, -0.4]},
    },
    "members": {"beam": {"nodes": ["A", "B"], "section": "s"}, "post": {"nodes": ["C", "D"], "section": "s"}},
    "contacts": {"c": {"type": "circle", "center": [0.6, -0.3], "radius": 0.15, "member": "beam", "node": "D"}},
}
"""A beam over a circle that a post carries, without sections."""

CROSSING = {
    "nodes": {
        "A": {"position": [0, 0, 0], "support": "clamped"},
        "B": {"position": [1, 0, 0]},
        "C": {"position": [0.6, -0.5, -0.1], "support": "clamped"},
        "D": {"position": [0.6, 0.5, -0.1]},
    },
    "members": {"beam": {"nodes": ["A", "B"], "section": "s"}, "post": {"nodes": ["C", "D"], "section": "s"}},
    "contacts": {"c": {"type": "members", "members": "all", "radius": 0.04}},
}
"""A beam over a post across it, without sections."""


FLOOR = {"type": "plane", "point": [0, -0.3], "normal": [0, 1]}
DRUM = {"type": "circle", "center": [0.6, -0.5], "radius": 0.3}


def pressed_on(contact, load=(0, -2), accuracy=1e-9, **more):
    """A cantilever of unit length with a force at its end, and an obstacle."""
    return {
        "sections": {"s": {"EI3": 1.0}},
        "nodes": {"A": {"position": [0, 0], "support": "clamped"}, "B": {"position": [1, 0]}},
        "members": {"beam": {"nodes": ["A", "B"], "section": "s"}},
        "loads": {"F": {"type": "force", "node": "B", "value": list(load)}},
        "contacts": {"c": {**contact, "members": "all"}},
        "analysis": {"accuracy": accuracy},
        **more,
    }


def weight(value):
    return {"W": {"type": "distributed", "member": "beam", "value": [0, value]}}


ON_FLOOR = pressed_on({**FLOOR, "point": [0, -0.1]}, loads=weight(-60), accuracy=1e-5)
ON_DRUM = pressed_on({**DRUM, "center": [0.2, -0.33]}, (0, -30), accuracy=1e-6)
IN_PIPE = pressed_on(
    {"type": "circle", "side": "inside", "center": [0.5, 0.3], "radius": 0.6}, loads=weight(-200), accuracy=1e-5
)
