"""Optimal control of motions by direct collocation and IPOPT, and replays of commands."""
