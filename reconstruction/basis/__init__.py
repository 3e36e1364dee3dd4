"""The modal basis of a rest shape: mesh, distances, modes (paper §3)."""
