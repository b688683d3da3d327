"""The two ways in which a scene can fail."""


class InputError(ValueError):
    """A scene that cannot be run as it stands: names field, value, unit and remedy."""


class LimitError(RuntimeError):
    """A limit violated during a run: says where, when, by how much, and what to change."""
