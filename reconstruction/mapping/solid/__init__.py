"""A solid: its rest shape from view-spread keyframes, by robust bundle adjustment."""
