"""Fixtures of the environments' tests."""

from __future__ import annotations

import pytest

from kengoro_env.stepping import choice
from kengoro_env.stepping.compiled_steps import CompiledSteps
from kengoro_env.stepping.numpy_steps import NumpySteps


@pytest.fixture(params=[CompiledSteps, NumpySteps])
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> type:
    """By compiled code and by NumPy and `mujoco.batch`: the class that steps environments."""
    kind: type = request.param
    if kind is NumpySteps:
        monkeypatch.setattr(choice, "library", lambda: None)
    elif choice.library() is None:
        pytest.skip("there is no compiled code here")
    return kind
