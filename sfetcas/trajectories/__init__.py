"""Motions as optimal control: what drives a scene is looked for, by direct collocation and IPOPT."""
