"""Solving the equations of one mesh: start, Newton, inertia, constraints, the program for IPOPT, curves."""
