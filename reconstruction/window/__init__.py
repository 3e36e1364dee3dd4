"""The on-line bundle adjustment: data term, energy, priors, solver, window (paper §5)."""
