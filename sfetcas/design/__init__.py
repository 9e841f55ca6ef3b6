"""Inverse problems, design over several load cases, and quasi-static trajectories: all equilibria at once."""
