"""What goes wrong before or around an experiment."""

from kengoro.errors import UsageError


class ExperimentError(UsageError):
    """Something that the user asked for cannot be done; the message says what would be valid."""
