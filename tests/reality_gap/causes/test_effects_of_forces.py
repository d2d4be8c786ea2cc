"""Effects on positions and velocities that depend on forces say so, as these jump with commands."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Effects, Record
from reality_gap.simulation.hypothesis import build
from reality_gap.study.system import System
from reality_gap.types import Floats
from tests.reality_gap.causes.machines import first_of_each_kind, records, towards_null

OF_FORCES = {"joint_elasticity", "tendon_elasticity", "slack"}


def added(effects: Effects, record: Record) -> Floats:
    """What effects add to positions and velocities."""
    model, changed = record.model, replace(record, sensors=record.sensors.copy())
    smooth = [
        column
        for i in range(model.nsensor)
        if int(model.sensor_needstage[i]) < int(mujoco.mjtStage.mjSTAGE_ACC)
        for column in range(model.sensor_adr[i], model.sensor_adr[i] + model.sensor_dim[i])
    ]
    for effect in effects.readings:
        effect(changed)
    return (changed.sensors - record.sensors)[:, smooth]


@pytest.mark.parametrize("id", sorted(CATALOGUE))
@pytest.mark.parametrize("machine", ["elbow", "arm", "hand", "screw"])
def test_they_are_listed(systems: dict[str, System], machine: str, id: str) -> None:
    system = systems[machine]
    for candidate in first_of_each_kind(system, CATALOGUE[id]):
        part = candidate, towards_null(candidate, 1.0)
        effects = build(system, [part]).effects
        if not effects.readings:
            continue
        record = records(system, part)[0]
        stronger = replace(record, force=record.force * 1.5 + 1.0)

        depends = not np.allclose(added(effects, record), added(effects, stronger), atol=1e-12)

        assert bool(effects.of_forces) or not depends, str(candidate)
        assert id in OF_FORCES or not effects.of_forces, str(candidate)
