"""Contact as inequality constraints: sets of touches, stretches, rolling, and the way to a state in contact.

A *touch* is a contact of a member with an obstacle, at a single place or along a *stretch*; *conditions* are the
equations that determine the places of contact along members; a *way* is a path of loads from 0 to 1.
"""
