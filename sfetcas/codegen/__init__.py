"""Generated C: an equilibrium as one file without dependencies."""
