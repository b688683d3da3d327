"""Snapshots that cannot be decomposed, and processes that are gone."""


class InputError(ValueError):
    """The caller's snapshots or settings are unusable; the message names field, value, unit and remedy."""


class LostRankError(RuntimeError):
    """Another process that shares the rows has ended; nothing can be summed any more."""
