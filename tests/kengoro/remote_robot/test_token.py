"""The token that robot and agent share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from kengoro.remote_robot.__main__ import main
from kengoro.remote_robot.client import RemoteRobot
from kengoro.remote_robot.token import (
    FILE_VARIABLE,
    VARIABLE,
    TokenError,
    new_token,
    proof,
    proves,
    read_token,
)

TOKEN = "a token of the tests"


def in_file(tmp_path: Path, mode: int, text: str = f"{TOKEN}\n") -> dict[str, str]:
    path = tmp_path / "token"
    path.write_text(text, encoding="utf-8")
    path.chmod(mode)
    return {FILE_VARIABLE: str(path)}


def test_it_comes_from_the_environment_or_a_private_file(tmp_path: Path) -> None:
    assert read_token({VARIABLE: TOKEN}) == TOKEN
    assert read_token(in_file(tmp_path, 0o600)) == TOKEN


@pytest.mark.skipif(os.name != "posix", reason="other systems have other permissions")
@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o666])
def test_a_file_that_others_may_use_is_refused(tmp_path: Path, mode: int) -> None:
    with pytest.raises(TokenError, match="chmod 600"):
        read_token(in_file(tmp_path, mode))


@pytest.mark.parametrize(
    ("environment", "sentence"),
    [
        ({}, "needs a token: set KENGORO_ROBOT_TOKEN"),
        ({VARIABLE: "short"}, "at least 16"),
        ({FILE_VARIABLE: "/no/such/file"}, "cannot be read"),
        ({FILE_VARIABLE: "/"}, "cannot be read"),
    ],
)
def test_what_is_no_token_is_refused(environment: dict[str, str], sentence: str) -> None:
    with pytest.raises(TokenError, match=sentence):
        read_token(environment)


def test_an_empty_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TokenError, match="has 0 characters"):
        read_token(in_file(tmp_path, 0o600, ""))


def test_a_proof_is_of_one_side_and_one_challenge() -> None:
    answer = proof(TOKEN, "agent", "1")
    assert proves(answer, TOKEN, "agent", "1")
    for wrong in (
        (answer, new_token(), "agent", "1"),
        (answer, TOKEN, "robot", "1"),
        (answer, TOKEN, "agent", "2"),
        ("", TOKEN, "agent", "1"),
        ("\u00e9", TOKEN, "agent", "1"),
    ):
        assert not proves(*wrong)


def test_no_side_starts_without_a_token(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.delenv(FILE_VARIABLE, raising=False)
    assert main(["Posture"]) == 2
    assert "needs a token" in capsys.readouterr().err
    with pytest.raises(TokenError, match="needs a token"):
        RemoteRobot(1)


@pytest.mark.parametrize(
    "arguments", [["--host", "192.0.2.1"], ["--port", "70000"], ["--host", "no such host"]]
)
def test_an_address_at_which_it_cannot_listen_is_named(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(VARIABLE, TOKEN)
    assert main(["Elbow", *arguments]) == 2
    assert "cannot listen at" in capsys.readouterr().err
