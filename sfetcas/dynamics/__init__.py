"""Motion and modes: masses, the equations of a time step, integrators, and what they give by name."""
