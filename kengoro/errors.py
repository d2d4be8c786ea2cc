"""The root of the errors that kengoro raises on purpose."""


class UsageError(ValueError):
    """What was asked for cannot be done; the message says what would be valid."""
