"""Solving the equations of one mesh: start, Newton, inertia, doctor, the program for IPOPT, curves of equilibria."""
