"""What a person can do wrong, apart from the video and the points themselves."""


class UsageError(ValueError):
    """An option or file that cannot be used; the message names it and the remedy."""
