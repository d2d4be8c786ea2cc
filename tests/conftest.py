"""Settings of every test run."""

import os

import pytest
from hypothesis import settings

# One thread: sums keep their order, so the same seed gives the same bits. Numpy reads
# these when they are imported, which happens after this file.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

# Chooses MUJOCO_GL, which mujoco reads when it is imported: so no test depends on whether another
# test has imported kengoro_env before.
import kengoro_env  # noqa: E402, F401

settings.register_profile("kengoro", deadline=None, derandomize=True)
settings.load_profile("kengoro")


@pytest.fixture
def frictionless(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tendons lack even the usual friction, as in a machine that equals its nominal model."""
    monkeypatch.setattr("reality_gap.causes.coulomb_friction.USUAL", 0.0)
