"""The root of everything that `jmm_agent` raises on purpose."""


class AgentError(ValueError):
    """Bad input to the agent, said in one sentence: what was wrong, where, what would be valid."""
