"""Mathematics independent of mechanics: quaternions, interpolation, curves, sparse matrices, kernels, programs."""
