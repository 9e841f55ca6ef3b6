"""Static analysis: from a scene to certified equilibria, with mesh refinement, branch choice and search for several."""
