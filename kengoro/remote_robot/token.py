"""Secret token that robot and agent share, and how each proves to the other that it knows it.

The token comes from the environment or from a file that only its owner may read, never from the
command line, which every user of a computer can list. It is not sent: each side sends a random
challenge and receives its HMAC. What follows is neither encrypted nor signed: on a network that
others can write to, use a tunnel such as ssh.
"""

from __future__ import annotations

import hmac
import os
import secrets
import stat
from collections.abc import Mapping
from pathlib import Path

from kengoro.errors import UsageError

VARIABLE, FILE_VARIABLE = "KENGORO_ROBOT_TOKEN", "KENGORO_ROBOT_TOKEN_FILE"
"""Variables of the environment that hold the token, or the path of its file."""
LEAST = 16
"""Least number of characters."""


class TokenError(UsageError):
    """There is no token, or it cannot be used."""


def read_token(environment: Mapping[str, str] | None = None) -> str:
    """The token of the environment, or of the file that the environment names.

    Args:
        environment: variables; those of this process if left out.

    Raises:
        TokenError: there is none, others may read its file, or it is too short.
    """
    environment = os.environ if environment is None else environment
    token, path = environment.get(VARIABLE, ""), environment.get(FILE_VARIABLE, "")
    if not token and not path:
        raise TokenError(
            f"A robot needs a token: set {VARIABLE}, or {FILE_VARIABLE} to a file that only its "
            "owner may read."
        )
    return checked(token or _file_content(Path(path)))


def checked(token: str) -> str:
    """The token, if it is long enough."""
    if len(token) < LEAST:
        raise TokenError(
            f"The token of a robot has {len(token)} characters; it must have at least {LEAST}."
        )
    return token


def new_token() -> str:
    """A random token."""
    return secrets.token_hex(32)


def proof(token: str, side: str, challenge: str) -> str:
    """What a side answers to a challenge.

    Args:
        token: that both sides know.
        side: "agent" or "robot", so that no answer can be sent back as the other side's.
        challenge: random text of the other side.
    """
    return hmac.new(token.encode(), f"{side} {challenge}".encode(), "sha256").hexdigest()


def proves(answer: str, token: str, side: str, challenge: str) -> bool:
    """Whether an answer is the proof of a side; takes the same time for every answer."""
    return hmac.compare_digest(answer.encode(), proof(token, side, challenge).encode())


def _file_content(path: Path) -> str:
    try:
        with path.open(encoding="utf-8") as file:
            status = os.fstat(file.fileno())
            text = file.read(4096).strip()
    except (OSError, ValueError) as error:
        raise TokenError(f"The token's file {path} cannot be read ({error}).") from error
    if os.name == "posix":
        if status.st_uid != os.geteuid():
            raise TokenError(f"The token's file {path} belongs to another user.")
        if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise TokenError(
                f"The token's file {path} may be used by others: chmod 600 makes it private."
            )
    return text
