"""Input that cannot be decided upon, refused with one clear message."""


class InputError(ValueError):
    """The caller's data or settings are unusable; the message names field, value, unit and remedy."""
