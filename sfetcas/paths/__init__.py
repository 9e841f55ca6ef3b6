"""Paths of equilibria over a load factor, with and without contact: limit points, bifurcations, branches, flutter."""
