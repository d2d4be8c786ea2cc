"""Errors that kengoro_env raises on purpose.

Each message is one sentence: what was wrong, where, and what would be valid. Each class derives
from `KengoroError` and from the built-in exception that fits, so that ``except ValueError`` works.
"""

from __future__ import annotations

from collections.abc import Iterable


class KengoroError(Exception):
    """Base class of all errors that kengoro_env raises on purpose."""


class ArgumentError(KengoroError, ValueError):
    """An argument, option or value that cannot be used."""


class InvalidActionError(ArgumentError):
    """An action of the wrong shape, not finite, or out of [-1, 1]."""


class UnknownNameError(KengoroError, KeyError):
    """A name of a muscle, task, departure or option that does not exist.

    Args:
        kind: what the name should denote, such as "muscle".
        name: the unknown name.
        known: the valid names.
    """

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        super().__init__(kind, name, tuple(known))  # the arguments that pickle passes on

    def __str__(self) -> str:
        kind, name, known = self.args
        return f"unknown {kind} {name!r}; known: {', '.join(known)}"


class ModelError(KengoroError, ValueError):
    """A model file that is missing or broken, or a robot that MuJoCo cannot simulate."""


class AssetError(KengoroError, OSError):
    """An asset that is missing, or a name that leads out of the assets folder."""


class EpisodeError(KengoroError, RuntimeError):
    """A step without an episode, or a first reset of some environments only."""


class DivergedError(KengoroError, RuntimeError):
    """The state of the simulation is no longer finite."""

    def __str__(self) -> str:
        return "the simulation diverged: its state is no longer finite"


class NotCompiledError(KengoroError, RuntimeError):
    """The C code cannot be compiled; the message gives the reason."""


class RenderingError(KengoroError, RuntimeError):
    """No GL library can render here; the message says what to install."""
