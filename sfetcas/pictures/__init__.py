"""Pictures of scenes, equilibria, paths and motions; the only package that imports matplotlib."""
