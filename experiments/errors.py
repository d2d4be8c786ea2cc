"""What goes wrong before or around an experiment."""


class ExperimentError(Exception):
    """Something that the user asked for cannot be done; the message says what would be valid."""
