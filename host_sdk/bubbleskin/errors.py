"""The one family of errors."""


class BubbleskinError(Exception):
    """Something went wrong that its message explains: what was asked, what was allowed, what to do next."""
