"""Refused input: one message that names the field, its value, its unit and the remedy."""


class Refusal(ValueError):  # noqa: N818  the program refuses, it has not erred
    """Input that cannot be used as it is; the command line prints the message alone and leaves with exit code 2."""
