"""Many solves at once: the cases of a sweep, who solves them, and the table of what comes out."""
