"""Where members of a state are strained beyond what the laws of their sections are known for, or good for.

A law ends with its table, may have no stiffness in some direction, and may lose convexity.  Each such finding has a
key, so that a path or a motion tells it once, where it is first met.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array, first_of_largest
from ..mathematics.forms import BOTH
from .fields import Fields
from .laws import law_of, least_stiffness
from .stretch_laws import least_tangent, stretch_law_of

__all__ = ["beyond_laws", "first_beyond_laws"]

GUESS = "beyond the end the law is a guess, with the slope there"
OTHERS = "a finer mesh may find other shapes there"

Told = Iterator[tuple[str, str]]
"""What is found, by which it is told once, and the sentence."""


def beyond_laws(fields: Fields) -> dict[tuple[str, str], str]:
    """Sentences on members, by what is found and the member.

    Looked for at the nodes of all elements and between them.
    """
    found: dict[tuple[str, str], str] = {}
    for looked_at in (_of_stretch, _of_bending):
        for name in fields.model.members:
            found |= {(what, name): sentence for what, sentence in looked_at(fields, name)}
    return found


def first_beyond_laws(states: Iterable[tuple[str, Fields]]) -> tuple[str, ...]:
    """The sentences of states in their order, each (where, fields), each behind where it is met first."""
    found: dict[tuple[str, str], str] = {}
    for where, fields in states:
        for key, sentence in beyond_laws(fields).items():
            found.setdefault(key, f"{where} {sentence}")
    return tuple(found.values())


def _of_bending(fields: Fields, name: str) -> Told:
    scene, model = fields.model.scene, fields.model
    law, line = law_of(scene, name), scene.center_lines[name]
    if law is None:
        return
    section = scene.sections[str(scene.members[name].section)]
    nodes = model.along(name)
    x = np.sort(np.concatenate([nodes, 0.5 * (nodes[1:] + nodes[:-1])]))
    along, form = fields.along(name, x), law.form_in(section)
    change = along["curvature"] - line.curvatures(x)
    bent = change[:, form.about - 1] if form.about else np.hypot(change[:, 1], change[:, 2])
    law_name = f"the law {law.type!r} of section {str(scene.members[name].section)!r}"
    if form.strains:
        centre = section.arms(x) if section.shifted else np.zeros((len(x), 3, 3))
        strain = along["strain"] - np.einsum("nij,nj->ni", centre, change)
        change = np.concatenate([change, strain[:, : form.strains]], axis=1)
        yield from _of_fibres(law, section, x, strain[:, 0], bent, f"{law_name} ends", name)
    # Where the section stretches it is the strain of fibres that ends a law.
    low, high = (np.full(len(x), end) for end in law.span) if form.strains else law.reach(section, x).T
    over = np.maximum(bent - high, low - bent)
    i = int(np.argmax(over))
    if over[i] > tolerances.WRITTEN * max(abs(low[i]), abs(high[i])):
        end = high[i] if bent[i] > high[i] else low[i]
        yield (
            "end",
            f"{law_name} ends at a curvature of {end:.6g} 1/m, and member {name!r} bends by {bent[i]:.6g} 1/m at "
            f"{x[i]:.3g} of its length: {GUESS}",
        )
    slack = law.slack(section, x, change)
    i = first_of_largest(np.maximum(slack, 0.0))
    # A gap keeps rounding from deciding.
    if slack[i] > tolerances.ALIKE:
        yield (
            "slack",
            f"{law_name} has no stiffness against bending where the twist is larger than the curvature, as "
            f"{abs(change[i, 0]):.4g} beside {abs(change[i, 2]):.4g} 1/m in member {name!r} at {x[i]:.3g} of its "
            "length: many shapes have the same energy there",
        )
    if law.convex:
        return
    least = least_stiffness(scene, name, x, change, fields.changeable(name))
    i = int(np.argmin(least))
    if least[i] < 0.0:
        where, more = (", ".join(f"{entry:.4g}" for entry in part) for part in (change[i, :3], change[i, 3:]))
        strained = f" and strains of ({more})" if more else ""
        yield (
            "not convex",
            f"{law_name} is not convex at changes of the curvatures of ({where}) 1/m{strained}, as of member {name!r} "
            f"at {x[i]:.3g} of its length: {OTHERS}",
        )


def _of_fibres(law: Any, section: Any, x: Array, strain: Array, bent: Array, ends: str, member: str) -> Told:
    """Where a fibre of a section that stretches is strained further than its law is known."""
    form, (low, high) = law.form_in(section), law.fibre_span
    if not np.isfinite(high):
        return
    reach = section.fibres(x)[:, 2 if form.about == BOTH else form.about - 1] * np.abs(bent)
    over = np.maximum(strain + reach - high, low - strain + reach)
    i = first_of_largest(np.maximum(over, 0.0))
    if not over[i] > tolerances.WRITTEN * max(abs(low), abs(high)):
        return
    above = strain[i] + reach[i] - high == over[i]
    end, there = (high, strain[i] + reach[i]) if above else (low, strain[i] - reach[i])
    yield (
        "end of fibres",
        f"{ends} at a strain of {end:.6g}, and a fibre of member {member!r} has {there:.6g} at {x[i]:.3g} of its "
        f"length: {GUESS}",
    )


def _of_stretch(fields: Fields, name: str) -> Told:
    scene = fields.model.scene
    law = stretch_law_of(scene, name)
    if law is None:
        return
    x, (low, high) = fields.model.along(name), law.span
    strain = fields.along(name, x)["strain"][:, 0]
    where = f"the law of stretch {law.type!r} of section {str(scene.members[name].section)!r}"
    over = np.maximum(strain - high, low - strain)
    i = first_of_largest(np.maximum(over, 0.0))
    if over[i] > tolerances.WRITTEN * max(abs(low), abs(high)):
        end = high if strain[i] > high else low
        yield (
            "end of stretch",
            f"{where} ends at a strain of {end:.6g}, and member {name!r} has {strain[i]:.6g} at {x[i]:.3g} of its "
            f"length: {GUESS}",
        )
    least = np.ones(len(x)) if law.convex else least_tangent(scene, name, x, strain)
    i = int(np.argmin(least))
    if least[i] < -tolerances.WRITTEN:
        yield (
            "stretch not convex",
            f"{where} is not convex at a strain of {strain[i]:.4g}, as of member {name!r} at {x[i]:.3g} of its length: "
            f"{OTHERS}",
        )
