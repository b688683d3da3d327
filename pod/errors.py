"""Snapshots that cannot be decomposed, refused with one clear message."""


class InputError(ValueError):
    """The caller's snapshots or settings are unusable; the message names field, value, unit and remedy."""
