"""Environments for tests with other libraries: kept, and skipped without a registry only."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import library_environments
from tests.library_environments import FOLDER, environment

CONTENT = ("some-library[extra]~=1.2", "another")


@pytest.fixture
def installs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """What was installed; nothing is."""
    noted: list[tuple[str, ...]] = []

    def note(python: Path, *arguments: str) -> str:
        noted.append(arguments)
        return ""

    def make(command: list[Path], check: bool) -> None:
        command[-1].mkdir()

    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr(library_environments, "_install", note)
    monkeypatch.setattr(library_environments.subprocess, "run", make)
    return noted


def test_an_environment_is_made_once(
    installs: list[tuple[str, ...]], request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    python = environment(request.config, *CONTENT)
    assert python == environment(request.config, *CONTENT)
    assert python.parents[2] == tmp_path
    assert python.parents[1].name.startswith("some-library-")
    [arguments] = installs
    assert arguments[-2:] == CONTENT
    assert "torch~=2.13.0" in arguments
    other = environment(request.config, "some-library~=1.3")
    assert (other != python, len(installs)) == (True, 2)


@pytest.mark.parametrize("reached", [True, False])
@pytest.mark.usefixtures("installs")
def test_an_error_is_a_failure_if_the_registry_can_be_reached(
    reached: bool, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(library_environments, "_install", lambda *_: "no such release")
    monkeypatch.setattr(library_environments, "_reaches_the_registry", lambda *_: reached)
    result = pytest.fail.Exception if reached else pytest.skip.Exception
    for _ in range(2):  # half an environment is not kept
        with pytest.raises(result, match=r"some-library.*: no such release"):
            environment(request.config, *CONTENT)
        monkeypatch.setattr(library_environments.subprocess, "run", lambda *_, **__: None)
