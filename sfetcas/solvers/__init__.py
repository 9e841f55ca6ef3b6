"""Solving the equations of one mesh: start, Newton, inertia, constraints, the program for IPOPT, curves.

Words that the modules share; those of :mod:`sfetcas.mechanics` hold as well.

- *unknowns*: increments of rotations (rotation vectors about the fixed axes, rad; one angle in the plane and about the
  axis of a hinge to the ground), then displacements over the length scale of the model;
- *rows*: scalar constraints, of loop closures (*closings*) and joints; the value of a row is its *gap*;
- *total*: number of unknowns and rows, the size of the Newton matrix ``[[H, A^T], [A, 0]]``, where ``H`` is the second
  derivative of the Lagrangian by the unknowns and ``A`` the Jacobian of the rows;
- *energy on the closings*: the quadratic form of ``H`` on the null space of ``A``; with potential the state is stable
  where it is positive definite, its negative eigenvalues are *ways out*, its zero ones *neutral*;
- *weight*: diagonal metric of the rotation unknowns, see :class:`~sfetcas.solvers.stability.StabilityTest`;
- *proximal term*: primal regularisation, a small share of the weight on the diagonal of ``H``; *softness*: the dual
  one, subtracted from the diagonal of the rows;
- *loose* or *redundant*: a combination of rows whose derivative by all unknowns vanishes, so that its multiplier is
  not determined; *slack*: the absence of such ones along straight members;
- *factor*: the number that multiplies loads and prescribed motions; a *loading* is these at one factor.
"""
