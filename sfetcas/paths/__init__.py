"""Paths of equilibria over a factor or a motion, with and without contact: limit points, bifurcations, branches."""
