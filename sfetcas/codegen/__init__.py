"""Generated C99 without dependencies: equilibrium solvers, time steps, and derivatives of an equilibrium's program."""
