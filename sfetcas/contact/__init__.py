"""Contact as inequality: what touches where, stretches, rolling, and the way to the touching state."""
