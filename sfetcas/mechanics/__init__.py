"""From a scene to its equations: elements, joints, springs and loads as terms of a Lagrangian, in numbers and symbols.

Words that the modules share:

- *rotation*: of a section or body since the undeformed scene, an angle in the plane, a unit quaternion in space;
- *place*: a point whose displacement the model knows: a node, a cut within a member, a sliding end;
- *segment*: a run of elements of a member between two places; its *reach* is the vector between their positions;
- *closing*: a loop closure: the segments of a loop, or a member between places with known displacements, must meet;
- *row*: a scalar constraint, of a closing or a joint, with its multiplier;
- *retained*: a place whose displacement is an unknown, or prescribed; displacements of others follow from the segments;
- *fixed*, *held*: restrained by a support or prescribed by a motion;
- *pull*: minus the internal force at an integration point;
- *turn*: a rotation, or its number in the model; *turned*: rotated by it;
- *side*: a rotation or place that a term connects.
"""
