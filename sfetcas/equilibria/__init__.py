"""The whole way from a scene to certified equilibria by name: meshes that answer errors, branches, several states."""
