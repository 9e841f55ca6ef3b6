"""Dynamics: masses, equations of motion, time integrators, modes of vibration, and their answers by name."""
