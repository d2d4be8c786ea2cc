"""Error of the experiments."""

from kengoro.errors import UsageError


class ExperimentError(UsageError):
    """An invalid request to an experiment; the message says what would be valid."""
