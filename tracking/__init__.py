"""Video in, point observations out: frames, corners, pyramidal LK, consistency, W^f and h^f."""


class TrackingError(ValueError):
    """A video, region or track file that cannot be used; the message names it and the remedy."""
