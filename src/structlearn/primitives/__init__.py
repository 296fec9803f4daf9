"""Dynamic movement primitives: canonical system, kernels, position, orientation, sensor traces, sequences."""
