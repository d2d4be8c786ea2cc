"""System: what a study measures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.study.data import Channel
from reality_gap.study.system import compile_system, measures_forces
from tests.reality_gap.study.one_hinge import MODEL, hinge, study

SENSORS = """<jointactuatorfrc name="torque" joint="j"/><actuatorfrc name="force" actuator="m"/>
</sensor><actuator><motor name="m" joint="j"/></actuator></mujoco>"""


def test_a_log_of_positions_measures_no_force(tmp_path: Path) -> None:
    assert not measures_forces(compile_system(study(hinge(tmp_path), np.zeros(20))))


@pytest.mark.parametrize("sensor", ["torque", "force"])
def test_a_sensor_of_torque_or_force_does(tmp_path: Path, sensor: str) -> None:
    model = hinge(tmp_path)
    model.write_text(MODEL.replace("</sensor></mujoco>", SENSORS))
    measured = study(model, np.zeros(20))
    channel = Channel("load", sensor, unit="N m")
    measured = replace(measured, channels=(channel,))
    [episode] = measured.episodes
    command = np.zeros((len(episode.time), 1))
    measured = replace(measured, episodes=(replace(episode, command=command),))

    assert measures_forces(compile_system(measured))
