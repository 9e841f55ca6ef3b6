"""Loads, sizes, ratios, meshes and steps far beyond use: what is right there, and how breaking is told."""
