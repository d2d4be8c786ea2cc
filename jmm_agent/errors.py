"""Root of all errors that `jmm_agent` raises on purpose."""


class AgentError(ValueError):
    """Input that the agent cannot use: what was wrong, where, and what would be valid."""


def positive(where: str, **numbers: float) -> None:
    """Refuse numbers that are not positive and finite.

    Args:
        where: what the numbers are of, for the message.
        numbers: by name.

    Raises:
        AgentError: a number is zero, negative, infinite or not a number.
    """
    for name, number in numbers.items():
        if not 0.0 < number < float("inf"):
            raise AgentError(f"{where}: {name} is {number}, but must be positive and finite.")
