"""Answers as pages for a browser: one file that turns, plays and tells its values without a network."""
