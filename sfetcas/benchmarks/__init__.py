"""Measurements, each run by ``python -m sfetcas.benchmark NAME``, and the scenes at random that they and tests use."""
