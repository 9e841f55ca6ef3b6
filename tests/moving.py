"""Scenes of motions for the tests of what is printed, drawn and written; quick, as step and mesh are prescribed."""

FALLING = {
    "title": "a hinged beam falls",
    "gravity": [0, -9.81],
    "sections": {"strip": {"EI3": 0.5, "rhoA": 1.0}},
    "nodes": {"A": {"position": [0, 0], "support": "hinge"}, "B": {"position": [1, 0]}},
    "members": {"beam": {"nodes": ["A", "B"], "section": "strip", "element": "SFET3", "elements": 2}},
    # One run: step and mesh are prescribed.
    "analysis": {"type": "dynamic", "end": 0.3, "step": 0.01, "output": 0.02},
}
"""A hinged beam that its weight turns down."""

STRUCK = {
    **FALLING,
    "loads": {"strike": {"type": "force", "node": "B", "value": [0, 1e3], "history": "h"}},
    "histories": {"h": {"t": [0, 0.1, 0.15], "value": [0, 0, 50]}},
    "analysis": {"type": "dynamic", "end": 0.3, "step": 0.05, "output": 0.02},
}
"""From 0.1 s on a force of up to 50 kN turns the beam, 1 kg, by many turns in one of the fixed steps."""

SPACE = {
    "title": "a double pendulum in space",
    "gravity": [0, 0, -9.81],
    "sections": {"s": {"EI2": 0.5, "EI3": 0.3, "GJ": 0.4, "rhoA": 0.3, "rhoI": [2e-4, 1e-4, 1e-4]}},
    "nodes": {
        "A": {"position": [0, 0, 0], "support": "ball"},
        "B": {"position": [0.6, 0, 0], "joint": "ball"},
        "C": {"position": [0.6, 0.8, 0.1], "mass": 0.1},
    },
    "members": {
        "one": {"nodes": ["A", "B"], "section": "s", "element": "SFET3", "elements": 2},
        "two": {"nodes": ["B", "C"], "section": "s", "element": "SFET3", "elements": 2},
    },
    "analysis": {"type": "dynamic", "end": 0.6, "step": 0.005, "output": 0.02},
}
"""A flexible one, held by a ball, with a weight at its end."""
