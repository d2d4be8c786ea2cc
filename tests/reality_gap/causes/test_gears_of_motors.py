"""Causes of motors with a gear in the model, which acts like the same motor without one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.study.measurements import measured
from reality_gap.study.system import System, compile_system
from tests.reality_gap.causes.candidates import with_cause
from tests.reality_gap.causes.machines import ARM, arm_study, predict

PLAIN = '<position name="elbow" joint="elbow" kp="30" kv="1" forcerange="-2 2"/>'
FORCE = "force_elbow_0"
"""Channel of the force before the gear, which is another with a gear."""


def geared_arm(folder: Path, gear: float) -> System:
    """The arm whose elbow has a gear in its model, and the same motion by the nominal model."""
    kp, kv, limit = 30 / gear**2, 1 / gear**2, 2 / abs(gear)
    servo = (
        f'<position name="elbow" joint="elbow" gear="{gear}" kp="{kp}" kv="{kv}" '
        f'forcerange="{-limit} {limit}"/>'
    )
    assert PLAIN in ARM
    study = arm_study(folder, model=ARM.replace(PLAIN, servo))
    [episode] = study.episodes
    command = episode.command * np.array([1.0, gear])
    return compile_system(replace(study, episodes=(replace(episode, command=command),)))


@pytest.mark.parametrize("gear", [4.0, -0.25])
@pytest.mark.parametrize(
    ("id", "location", "values"),
    [
        ("dead_zone", "elbow", {"half_width": 0.03}),
        ("speed_limit", "elbow", {"slowness": 0.5}),
        ("torque_speed_curve", "elbow", {"drop": 0.5}),
        ("gear_friction", "elbow", {"coefficient": 0.3}),
        ("stribeck_friction", "elbow", {"stiction": 0.3, "speed": 0.5}),
        ("joint_elasticity", "elbow", {"compliance": 0.02}),
        ("motor_coupling", "elbow (with shoulder)", {"ratio": 0.3}),
        ("gravity_compensation", "elbow", {"share": 0.5}),
    ],
)
def test_a_gear_in_the_model_changes_no_motion(
    systems: dict[str, System],
    tmp_path: Path,
    gear: float,
    id: str,
    location: str,
    values: dict[str, float],
) -> None:
    plain, geared = systems["arm"], geared_arm(tmp_path, gear)
    names = [channel.name for channel in plain.study.channels]
    moved = measured(plain.study).channel != names.index(FORCE)
    expected = with_cause(plain, id, location, **values)

    assert np.abs(expected - predict(plain))[moved].max() > 5.0
    found = with_cause(geared, id, location, **values)
    np.testing.assert_allclose(found[moved], expected[moved], atol=1e-4)
