"""Measurements, each run by ``python -m benchmarks NAME``, and the scenes at random that they and tests use."""
