"""Scenes with rigid and small members, springs, joints of every kind and loads without potential."""

import numpy as np
from scenes import SOFT, UNLIKE, ZOO, arc_across


def linked():
    """Rigid crank, bent rigid corner and a flexible follower; springs of every kind of the plane; weight."""
    return {
        "sections": {"s": {**SOFT}, "bar": {"rhoA": 2.0}},
        "nodes": {
            "A": {"position": [0, 0], "support": "hinge"},
            "B": {"position": [0.2, 0.7], "joint": "hinge"},
            "C": {"position": [1.2, 0.9]},
            "E": {"position": [1.6, 0.8]},
            "D": {"position": [1.4, 0], "support": "clamped"},
        },
        "members": {
            "crank": {"nodes": ["A", "B"], "type": "rigid", "section": "bar"},
            "coupler": {"nodes": ["B", "C"], "type": "rigid", "shape": {"type": "arc", "angle": 0.8}},
            "arm": {"nodes": ["E", "C"], "type": "rigid", "section": "bar"},
            "follower": {
                "nodes": ["D", "C"],
                "section": "s",
                "release": ["rigid", "hinge"],
                "shape": {"type": "arc", "angle": -0.5},
            },
        },
        "springs": {
            "foot": {"node": "A", "stiffness": 2.0, "rest": 0.4},
            "pin": {"node": "B", "stiffness": 0.7, "between": ["crank", "coupler"], "rest": -0.3},
            "knee": {"node": "C", "stiffness": 0.5, "between": ["follower", "coupler"]},
            "rope": {"type": "translational", "node": "C", "to": "A", "stiffness": 1.5, "length": 1.1},
            "pull": {"type": "translational", "node": "E", "anchor": [2.0, 1.0], "stiffness": 0.8, "length": 0.2},
            "push": {"type": "translational", "node": "B", "direction": [1.0, 0.5], "stiffness": 1.2, "rest": 0.1},
        },
        "loads": {
            "tip": {"type": "force", "node": "E", "value": [1.4, -2.9]},
            "inside": {"type": "force", "member": "coupler", "at": 0.4, "value": [2.3, -1.8]},
            "couple": {"type": "moment", "member": "coupler", "at": 0.7, "value": 0.4},
            "wind": {"type": "distributed", "member": "coupler", "value": [0.2, -0.6]},
        },
        "gravity": [0.1, -0.7],
    }


def small_plane():
    """A flexible member, a curved small one and a slider; loads on the small one, and its weight."""
    return {
        "sections": {"s": {**SOFT}, "thick": {**SOFT, "EI3": {"at": [0, 1], "value": [3.0, 2.0]}}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [0.8, 0.2]},
            "C": {"position": [1.5, 0.9]},
            "D": {"position": [1.8, 0.2], "support": "slider", "direction": [1, 0.1], "rotation": "ball"},
        },
        "members": {
            "one": {"nodes": ["A", "B"], "section": "s"},
            "two": {"nodes": ["B", "C"], "section": "thick", "type": "small", "shape": {"type": "arc", "angle": 0.9}},
            "three": {"nodes": ["C", "D"], "section": "thick", "type": "small", "release": ["hinge", "rigid"]},
        },
        "loads": {
            "tip": {"type": "force", "node": "C", "value": [0.5, -0.4]},
            "inside": {"type": "force", "member": "two", "at": 0.3, "value": [-0.2, -0.5]},
            "wind": {
                "type": "distributed",
                "member": "three",
                "value": [0.2, -0.3],
                "profile": {"polynomial": [1, 1]},
            },
        },
        "gravity": [0.0, -0.6],
    }


def sliding_plane():
    """A collar on a flexible member, driven along it, a driven hinge, and an end that slides along another."""
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [0.9, 0.1], "direction": [1, 0.2]},
            "C": {"position": [1.2, 0.9]},
            "D": {"position": [0.3, 1.1], "direction": [0.2, 1]},
            "E": {"position": [-0.2, 1.6], "support": "clamped"},
        },
        "members": {
            "rail": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": 0.6}},
            "rod": {
                "nodes": ["B", "C"],
                "section": "s",
                "release": ["slider", "rigid"],
                "shape": {"type": "arc", "angle": 0.4},
            },
            "stay": {"nodes": ["C", "D"], "section": "s", "release": ["hinge", "rigid"]},
            "post": {
                "nodes": ["E", "D"],
                "section": "s",
                "release": ["rigid", "slider"],
                "shape": {"type": "arc", "angle": 0.5},
            },
        },
        "loads": {
            "push": {"type": "force", "node": "C", "value": [0.9, -1.2]},
            "side": {"type": "force", "node": "D", "value": [0.2, 0.3]},
        },
        "motions": {
            "collar": {"node": "B", "between": ["rail", "rod"], "displacement": [0.1, 0.02]},
            "elbow": {"node": "C", "between": ["rod", "stay"], "rotation": 0.3},
        },
    }


def linked_space():
    """Rigid members at skew hinges, one on a universal support; springs of every kind of space."""
    return {
        "sections": {"s": {**UNLIKE}, "bar": {"rhoA": 1.5}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "universal", "axis": [0, 0.2, 1], "axis2": [1, 0, 0]},
            "B": {"position": [0.3, 0.8, 0.2]},
            "C": {"position": [1.1, 0.9, 0.5], "axis": [0.3, 1, 0.2]},
            "D": {"position": [1.5, 0.1, 0.1], "support": "clamped"},
        },
        "members": {
            "crank": {"nodes": ["A", "B"], "type": "rigid", "section": "bar"},
            "coupler": {
                "nodes": ["B", "C"],
                "type": "rigid",
                "shape": arc_across([0.3, 0.8, 0.2], [1.1, 0.9, 0.5], 0.9, [0, 0.2, 1]),
            },
            "follower": {
                "nodes": ["D", "C"],
                "section": "s",
                "release": ["rigid", "hinge"],
                "shape": arc_across([1.5, 0.1, 0.1], [1.1, 0.9, 0.5], 0.6, [1, 0.3, 0]),
            },
        },
        "springs": {
            "foot": {"node": "A", "stiffness": 2.0, "rest": 0.4, "axis": [0.2, 0.1, 1]},
            "knee": {"node": "C", "stiffness": 0.5, "between": ["follower", "coupler"], "axis": [0.3, 1, 0.2]},
            "rope": {"type": "translational", "node": "C", "to": "A", "stiffness": 1.5, "length": 1.1},
            "pull": {"type": "translational", "node": "B", "anchor": [0.2, 1.5, 0.3], "stiffness": 2, "length": 0.3},
            "push": {"type": "translational", "node": "B", "direction": [1, 0.5, 0.2], "stiffness": 1.2, "rest": 0.1},
        },
        "loads": {
            "inside": {"type": "force", "member": "coupler", "at": 0.4, "value": [2.3, -2.8, 2.4]},
            "wind": {"type": "distributed", "member": "coupler", "value": [1.2, -1.3, 0.5]},
        },
        "gravity": [0.1, 0.0, -0.7],
    }


def small_space():
    """A flexible member, a small quarter of a helix and a small straight one on a cylindrical support."""
    helix = {"type": "helix", "radius": 0.6, "pitch": 1.2, "turns": 0.3, "axis": [0, 0, 1], "center": [0, 0, 0]}
    end = [0.6 * np.cos(0.6 * np.pi), 0.6 * np.sin(0.6 * np.pi), 0.36]
    return {
        "sections": {"s": {**UNLIKE}, "thick": {"EI2": 4.0, "EI3": 2.0, "GJ": 1.5, "rhoA": 0.3}},
        "nodes": {
            "A": {"position": [1.2, -0.5, 0.1], "support": "clamped"},
            "B": {"position": [0.6, 0, 0]},
            "C": {"position": end},
            "D": {"position": [-0.6, 0.2, 0.5], "support": "cylindrical", "direction": [0.2, 1, 0.1]},
        },
        "members": {
            "one": {"nodes": ["A", "B"], "section": "s"},
            "two": {"nodes": ["B", "C"], "section": "thick", "type": "small", "shape": helix},
            "three": {"nodes": ["C", "D"], "section": "thick", "type": "small", "release": ["ball", "rigid"]},
        },
        "loads": {
            "tip": {"type": "force", "node": "C", "value": [0.5, -0.4, 0.7]},
            "inside": {"type": "force", "member": "two", "at": 0.3, "value": [-0.2, -0.5, 0.4]},
            "wind": {"type": "distributed", "member": "two", "value": [0.2, 0.3, -0.5]},
        },
        "gravity": [0.0, 0.2, -0.6],
    }


def sliding_space():
    """A cylindrical joint along a flexible member, driven both ways, a universal joint, and an end that slides."""
    return {
        "sections": {"s": {**UNLIKE}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": [0.9, 0.1, 0.2], "direction": [1, 0.2, 0.1]},
            "C": {"position": [1.2, 0.9, 0.1], "axis": [0, 0.1, 1], "axis2": [1, 0, 0]},
            "D": {"position": [0.3, 1.1, 0.3], "direction": [0.2, 1, 0.3]},
            "E": {"position": [-0.2, 1.6, 0.1], "support": "clamped"},
        },
        "members": {
            "rail": {
                "nodes": ["A", "B"],
                "section": "s",
                "shape": arc_across([0, 0, 0], [0.9, 0.1, 0.2], 0.6, [0.2, 0, 1]),
            },
            "rod": {
                "nodes": ["B", "C"],
                "section": "s",
                "release": ["cylindrical", "rigid"],
                "shape": arc_across([0.9, 0.1, 0.2], [1.2, 0.9, 0.1], 0.5, [0, 0.3, 1]),
            },
            "stay": {"nodes": ["C", "D"], "section": "s", "release": ["universal", "rigid"]},
            "post": {
                "nodes": ["E", "D"],
                "section": "s",
                "release": ["rigid", "slider"],
                "shape": arc_across([-0.2, 1.6, 0.1], [0.3, 1.1, 0.3], 0.5, [0, 0.3, 1]),
            },
        },
        "loads": {
            "push": {"type": "force", "node": "C", "value": [0.9, -1.2, 1.0]},
            "side": {"type": "force", "node": "D", "value": [0.2, 0.3, -0.5]},
        },
        "motions": {
            "collar": {"node": "B", "between": ["rail", "rod"], "displacement": [0.1, 0.02, 0.01], "rotation": 0.3},
        },
    }


def following():
    """Followers at the tip, inside and along a bent cantilever, and at the end of a rigid arm."""
    return {
        "sections": {"s": {**SOFT}},
        "nodes": {
            "A": {"position": [0, 0], "support": "clamped"},
            "B": {"position": [1, 0.2]},
            "C": {"position": [1.2, 0.1]},
        },
        "members": {
            "m": {"nodes": ["A", "B"], "section": "s", "shape": {"type": "arc", "angle": 0.7}},
            "arm": {"nodes": ["B", "C"], "type": "rigid"},
        },
        "loads": {
            "tip": {"type": "force", "node": "C", "value": [0.3, 0.9], "frame": "follower"},
            "inside": {"type": "force", "member": "m", "at": 0.4, "value": [0.5, -0.8], "frame": "follower"},
            "suction": {"type": "distributed", "member": "m", "value": [0.2, 0.9], "frame": "follower"},
            "dead": {"type": "force", "node": "B", "value": [0.2, 0.3]},
            "couple": {"type": "moment", "node": "B", "value": 0.4},
        },
    }


def following_space():
    """The same on a bend in space with a second, held foot; moments about fixed and carried axes."""
    end = [0.7, 0.3, 0.2]
    return {
        "sections": {"s": {**UNLIKE}},
        "nodes": {
            "A": {"position": [0, 0, 0], "support": "clamped"},
            "B": {"position": end},
            "C": {"position": [1.2, -0.4, 0.3], "support": "hinge", "axis": [0.2, 1, 0.3]},
        },
        "members": {
            "m": {"nodes": ["A", "B"], "section": "s", "shape": arc_across([0, 0, 0], end, 0.7, [0, 0.2, 1])},
            "n": {
                "nodes": ["B", "C"],
                "section": "s",
                "shape": arc_across(end, [1.2, -0.4, 0.3], 0.9, [0.3, 0.2, 1]),
            },
        },
        "loads": {
            "node": {"type": "force", "node": "B", "value": [0.3, 0.9, -0.5], "frame": "follower"},
            "inside": {"type": "force", "member": "m", "at": 0.4, "value": [0.5, -0.8, 0.6], "frame": "follower"},
            "suction": {"type": "distributed", "member": "n", "value": [0.2, 0.9, 0.4], "frame": "follower"},
            "couple": {"type": "moment", "node": "B", "value": [0.4, -0.3, 0.5]},
            "carried": {
                "type": "moment",
                "member": "m",
                "at": 0.6,
                "value": [0.2, 0.6, -0.5],
                "frame": "follower",
            },
            "drive": {"type": "moment", "node": "C", "value": [0.1, 0.3, -0.2]},
        },
    }


PLANE_SYSTEMS = {f.__name__: f for f in (linked, small_plane, sliding_plane)}
SPACE_SYSTEMS = {f.__name__: f for f in (linked_space, small_space, sliding_space)}
SYSTEMS = {**PLANE_SYSTEMS, **SPACE_SYSTEMS}
FOLLOWING = {f.__name__: f for f in (following, following_space)}
EVERY = {**ZOO, **SYSTEMS}
EVERYTHING = {**EVERY, **FOLLOWING}
