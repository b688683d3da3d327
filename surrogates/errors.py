"""What a regressor refuses to be fitted to, or asked."""


class InputError(ValueError):
    """Data or a question no regressor should answer: the message names field, value, unit and remedy."""
