"""Elastic tendons of servos, in machines with a simulated spool whose commands are stairs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.inference.screening import list_candidates
from reality_gap.simulation.replayer import Replayer
from tests.reality_gap.causes.cable_drive import DRIVE, WINCH, Size, logged

LAG = 9e-3
"""Damping of the motors over the gains of their servos [s]."""
FINER = 0.125
"""Steps of replays over those of the model, whose own ones do not resolve stairs [1]."""


@pytest.mark.parametrize("size", [DRIVE, WINCH])
@pytest.mark.parametrize("damping", ["kv", "motor"])
def test_the_motor_follows_stairs_of_commands_by_its_damping(
    tmp_path: Path, size: Size, damping: str
) -> None:
    gain = size.sizes["kp"]
    sizes = {"cable": 0.4 * gain, "kv": 0.0} | {damping: LAG * gain}
    left = _left(tmp_path, size, **sizes)
    assert left["force"] == pytest.approx(1.0, abs=0.25)
    assert left["position"] == pytest.approx(1.0, abs=0.1)


def _left(folder: Path, size: Size, **sizes: float) -> dict[str, float]:
    """Return the error of each channel with the true compliance of the cable [noises]."""
    study = logged(folder, size, friction=0.0, held=True, **sizes)
    with Replayer(study) as replayer:
        listed = list_candidates(replayer.system, [CATALOGUE["tendon_elasticity"]])
        elastic = next(one for one in listed if len(one.location.elements) == 1)
        readings, part = replayer.measured, (elastic, {"compliance": 1.0 / sizes["cable"]})
        error = (readings.value - replayer.replay([part], FINER).prediction) / readings.noise
    channels = [channel.name for channel in study.channels]
    of = {name: error[readings.channel == i] for i, name in enumerate(channels)}
    return {name: float(np.sqrt(np.mean(one**2))) for name, one in of.items()}
