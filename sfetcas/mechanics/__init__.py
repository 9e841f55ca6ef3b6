"""From a scene to its equations: elements, joints, connections, loads and closings, in components and in rotations."""
