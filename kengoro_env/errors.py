"""The root of every error that kengoro_env raises on purpose."""


class KengoroError(Exception):
    """Root of them all; the message says what was wrong, where, and what would be valid."""
