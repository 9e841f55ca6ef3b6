"""The core in C: a model given as tables is evaluated, assembled and solved; ``core.h`` says what it takes.

It takes the same decisions on the same numbers as the modules in Python that say at their heads that they have it.
"""
