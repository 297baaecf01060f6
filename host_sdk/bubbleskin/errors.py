"""The one family of errors."""


class BubbleskinError(Exception):
    """Something went wrong that its message explains: what was asked, what was allowed, what to do next."""


class InvalidInput(BubbleskinError):  # noqa: N818 - a user reads it, and it is not the program's error
    """What the user gave cannot be meant: refused before anything else happens."""
