"""What tubes say along their own length: how they are turned, bent and twisted, and which moments they carry."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mathematics.arrays import Array
from .tubes import angles_along, sections_of, twist_behind

__all__ = ["fields_of_tube", "places_along"]


def places_along(model: Any, name: str) -> Array:
    """Fractions (n,) of the length of a tube, rising from 0 to 1, at the nodes of elements; behind the members at 0."""
    tube, found = model.scene.tubes[name], [0.0]
    for run in model.scene.tube_runs[name]:
        x = model.along(run.member)
        length = model.scene.center_lines[run.member].length
        found += ((run.begin + x[(x >= run.start) & (x <= run.end)] * length) / tube.length).tolist()
    places = np.clip(np.sort(found), 0.0, 1.0)
    places[-1] = 1.0
    return np.asarray(places[np.diff(places, prepend=-1.0) > APART])


APART = 1e-9
"""Of the length: places that are nearer to each other are one."""


def fields_of_tube(fields: Any, name: str, at: Array) -> dict[str, Array]:
    """Of a tube at fractions (n,) of its length: ``turn`` (n,) rad, ``curvature`` (n, 3) 1/m, ``moment`` (n, 3) N m.

    As of :meth:`.Configuration.along_tube`.
    """
    model, base = fields.model, fields.bases[name]
    tube = model.scene.tubes[name]
    own = np.asarray(at, dtype=float) * tube.length
    found = {"turn": np.full(len(own), base), "curvature": np.zeros((len(own), 3)), "moment": np.zeros((len(own), 3))}
    for run in model.scene.tube_runs[name]:
        length = model.scene.center_lines[run.member].length
        x = (own - run.begin) / length
        # Beyond the first and the last member rounding alone is left.
        here = np.flatnonzero((own >= -tube.start) & (x > run.start - APART) & (x < run.end + APART))
        if not len(here):
            continue
        x = np.clip(x[here], run.start, run.end)
        angle, twist, _ = angles_along(model, name, run.member, x, fields.twisted)
        turned, section, natural = sections_of(model, name, run, x, angle + base - run.turned)
        bent = np.einsum("nij,ni->nj", turned, fields.along(run.member, x)["curvature"])
        bent[:, 0] += twist
        found["turn"][here] = base + angle
        found["curvature"][here] = bent
        found["moment"][here] = np.einsum("nij,nj->ni", section, bent - natural)
    behind = np.flatnonzero(own < -tube.start)
    if len(behind):
        first = model.segments.angles[name][0, 0]
        twisted, twist, torque = twist_behind(model.scene, tube, own[behind], float(fields.twisted[first]))
        found["turn"][behind] += twisted
        found["curvature"][behind, 0] = twist
        found["moment"][behind, 0] = torque
    return found
