"""The frame loop: read, track, reconstruct, record."""
