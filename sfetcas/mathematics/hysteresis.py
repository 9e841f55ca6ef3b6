"""Potentials with memory of sections: fibres that slide or transform, with what is stored and what is dissipated.

What a section remembers are *internal variables* z.  From the values ``z`` at the end of the last step those at the
end of the next one minimise, at the curvatures x there,

    stored(x, z') + dissipation(z' - z)                                                          over z'.

The minimum w(x; z) is a convex potential of x with continuous slopes, the moments, and z' follows from x in closed form
(the play operator: z' stays where it is between two bounds that move with x).  Stored energy and dissipation together
are exact for a step within which each strain goes one way.

A section is a sum of fibres: the strain of each is ``e = s.x``, where the section stretches with the strain along over
the reach more, its energy counts with a weight, and all have the same material.  One fibre with ``s = 1`` is a law of
the moment itself.  The materials, with stress and strain over those at
the end of the first elastic range:

- ``sliders``: a spring beside a slider in series with a spring, elastic-plastic with linear kinematic hardening:
  stored ``p/2 e^2 + (1-p)/2 (e - z')^2``, dissipation ``(1-p) |z' - z|``.  With a vector of strains radial return.
- ``superelastic``: a transformation z from -1 to 1 that strains by ``t z'``: stored ``1/2 (e - t z')^2 + h/2 z'^2 +
  a |z'|``, dissipation ``d |z' - z|``.

Sources: Simo and Hughes 1998, "Computational inelasticity", section 1.2; Ortiz and Stainier 1999 (doi
10.1016/S0045-7825(98)00219-9) for the minimum over a step; Auricchio and Sacco 1997 (doi 10.1177/1045389X9700800602)
for superelastic beams.
"""

from __future__ import annotations

import casadi as ca

from .forms import BOTH, CONSTANTS, Form

__all__ = ["INSIDE", "energies", "lasting", "stiffness", "updated"]

INSIDE = 1e-12
"""Internal variables of the end of a step lie by this share of the elastic range within its bounds, so that rounding
does not decide whether a section begins the next step elastically: it does."""


def energies(form: Form, x: ca.SX, p: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Stored energy and dissipation since the last step at curvatures x (3,), and strains, with numbers p (size,).

    The stored one is less its quadratic part at rest.
    """
    stored, dissipated = -0.5 * ca.dot(stiffness(form, p), x[_axes(form)] ** 2), ca.SX(0)
    for weight, strain, z in _fibres(form, x, p):
        kept, lost = _MATERIALS[form.name][0](strain, p, z)
        stored, dissipated = stored + weight * kept, dissipated + weight * lost
    return stored, dissipated


def _axes(form: Form) -> list[int]:
    """Numbers of the curvatures and strains on which a form depends."""
    return [*((1, 2) if form.about == BOTH else (form.about - 1,)), *range(3, form.arguments)]


def stiffness(form: Form, p: ca.SX) -> ca.SX:
    """Stiffnesses at rest for these: one for curvatures, for the strain along by the weights of all fibres."""
    bending = ca.SX.ones(len(_axes(form)) - form.strains)
    if not form.strains:
        return bending
    first = CONSTANTS[form.name]
    return ca.vertcat(bending, ca.sum1(p[first + 1 : first + 1 + form.count]) / p[first] ** 2)


def updated(form: Form, x: ca.SX, p: ca.SX) -> ca.SX:
    """Internal variables (memory,) at the end of a step, at curvatures and strains x, with numbers p (size,)."""
    return ca.vertcat(*[_MATERIALS[form.name][1](strain, p, z, INSIDE) for _, strain, z in _fibres(form, x, p)])


def lasting(form: Form, x: ca.SX, p: ca.SX) -> ca.SX:
    """Inelastic curvatures (3,), and strains, at the end of a step: the moments and forces of what fibres have slid or
    transformed, over the stiffness at rest."""
    found, firm = ca.SX.zeros(form.arguments), stiffness(form, p)
    bent = ca.SX.sym("bent", form.arguments)
    share = 1.0 - p[0] if form.name == "sliders" else p[0]
    for (weight, strain, z), (_, at, _) in zip(_fibres(form, x, p), _fibres(form, bent, p), strict=True):
        now = _MATERIALS[form.name][1](strain, p, z, 0.0)
        # The work of the fibre's strain on each curvature.
        arms = ca.jacobian(at, bent)
        for axis, own in zip(_axes(form), ca.vertsplit(firm), strict=True):
            found[axis] += weight * share * ca.dot(arms[:, axis], now) / own
    return found


def _fibres(form: Form, x: ca.SX, p: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
    """Weight, strain and internal variables of each fibre."""
    n, width, places = form.count, form.variables, form.places
    bent = x[1:3] if form.about == BOTH else x[form.about - 1]
    weights = CONSTANTS[form.name] + form.strains
    where, z = weights + n, form.size - form.memory
    along = x[3] / p[weights - 1] if form.strains else 0.0
    found = []
    for i in range(n):
        # All weights, then all first places, then all second ones.
        place = [p[where + k * n + i] for k in range(places)]
        strain = ca.dot(ca.vertcat(*place), bent) if form.spread else place[0] * bent
        found.append((p[weights + i], strain + along, p[z + i * width : z + (i + 1) * width]))
    return found


# -- a slider, which may have a direction ------------------------------------------------------------------


def _slid(e: ca.SX, z: ca.SX, inside: float = 0.0) -> ca.SX:
    """What the slider's spring is strained by after a step, of magnitude at most 1."""
    free = e - z
    size = ca.sqrt(ca.fmax(ca.sumsqr(free), 1.0))
    share = ca.if_else(ca.sumsqr(free) > 1.0, (1.0 - inside) / size, 1.0)
    return free * share


def _slider_energies(e: ca.SX, p: ca.SX, z: ca.SX) -> tuple[ca.SX, ca.SX]:
    square = ca.sumsqr(e - z)
    # Of one number, and of the magnitude of two, the same: half the square up to 1, where the slider begins.
    over = ca.sqrt(ca.fmax(square, 1.0)) - 1.0
    return 0.5 * p[0] * ca.sumsqr(e) + 0.5 * (1.0 - p[0]) * ca.fmin(square, 1.0), (1.0 - p[0]) * over


def _slider_updated(e: ca.SX, p: ca.SX, z: ca.SX, inside: float) -> ca.SX:
    return ca.if_else(ca.sumsqr(e - z) > 1.0, e - _slid(e, z, inside), z)


# -- a transformation ----------------------------------------------------------------------------------------


def _transformed(e: ca.SX, p: ca.SX, z: ca.SX, inside: float = 0.0) -> ca.SX:
    """The transformation after a step: between the bounds at which the driving force meets what resists it."""
    t, h, a, d = ca.vertsplit(p[:4])
    force, stiffness = t * e, t**2 + h

    def at(drive: ca.SX) -> ca.SX:
        """Where a driving force is in balance, between -1 and 1."""
        lasting = ca.fmax(drive - a, 0.0) + ca.fmin(drive + a, 0.0)
        return ca.fmax(ca.fmin(lasting / stiffness, 1.0), -1.0)

    d = (1.0 - inside) * d
    return ca.fmax(at(force - d), ca.fmin(z, at(force + d)))


def _transformation_energies(e: ca.SX, p: ca.SX, z: ca.SX) -> tuple[ca.SX, ca.SX]:
    t, h, a, d = ca.vertsplit(p[:4])
    now = _transformed(e, p, z)
    return 0.5 * (e - t * now) ** 2 + 0.5 * h * now**2 + a * ca.fabs(now), d * ca.fabs(now - z)


_MATERIALS = {
    "sliders": (_slider_energies, _slider_updated),
    "superelastic": (_transformation_energies, _transformed),
}
