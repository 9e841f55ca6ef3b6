"""Sweeps: many solves of one scene with other numbers, their distribution to processes, and the table of results."""
