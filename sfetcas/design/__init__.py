"""Inverse problems, design over several load cases, and quasi-static trajectories, each as one nonlinear program."""
