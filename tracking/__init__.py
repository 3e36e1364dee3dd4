"""Video in, point observations out: frames, corners, pyramidal LK, consistency, W^f and h^f."""


class TrackingError(ValueError):
    """A video, region or track file that cannot be used; the message says what is wrong and what is needed.

    Args:
        text: the message.
        about: what it is about: truth, frames or drop_late; empty for anything else.
    """

    def __init__(self, text: str, about: str = "") -> None:
        super().__init__(text)
        self.about = about
