"""Root of all errors that `jmm_agent` raises on purpose."""


class AgentError(ValueError):
    """Input that the agent cannot use: what was wrong, where, and what would be valid."""
