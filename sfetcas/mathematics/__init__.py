"""Mathematics that knows no mechanics: quaternions, interpolation, curves, sparse matrices, kernels, programs."""
