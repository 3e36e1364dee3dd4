"""The first model, by the first frames alone: a rigid shape by factorisation, or a plane (paper §4)."""
