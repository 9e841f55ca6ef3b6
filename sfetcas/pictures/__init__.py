"""Pictures of scenes, equilibria and paths; the only place that knows matplotlib."""
