"""Readings with a wrong sign, unit or column are recognised by the model's replay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from reality_gap.simulation.column_errors import ColumnError, column_errors
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.types import Floats

ARM = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <body>
      <joint name="shoulder" axis="0 1 0" damping="0.3"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="{mass}"/>
      <body pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.2"/>
        <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.02" mass="0.6"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="60" kv="2"/>
    <position name="elbow" joint="elbow" kp="30" kv="1"/>
  </actuator>
  <sensor>
    <jointpos name="q1" joint="shoulder"/>
    <jointpos name="q2" joint="elbow"/>
    <actuatorfrc name="f1" actuator="shoulder"/>
    <actuatorfrc name="f2" actuator="elbow"/>
  </sensor>
</mujoco>
"""
CHANNELS = tuple(
    Channel(name, name, unit=unit, noise=noise)
    for name, unit, noise in (
        ("q1", "rad", 1e-3),
        ("q2", "rad", 1e-3),
        ("f1", "N m", 0.05),
        ("f2", "N m", 0.05),
    )
)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """A log of an arm whose upper arm is 40 % heavier than in the model."""
    path = tmp_path_factory.mktemp("arm") / "arm.xml"
    path.write_text(ARM.format(mass=1.0))
    model = mujoco.MjModel.from_xml_string(ARM.format(mass=1.4))
    data = mujoco.MjData(model)
    time = 0.01 * np.arange(600)
    command = np.column_stack([0.6 * np.sin(2.1 * time), 0.5 * np.sin(3.3 * time + 1.0) - 0.4])
    rows = np.zeros((len(time), 4))
    for row, target in zip(rows, command, strict=True):
        data.ctrl[:] = target
        mujoco.mj_step(model, data, 5)
        row[:] = data.sensordata
    rows += np.random.default_rng(0).standard_normal(rows.shape) * [1e-3, 1e-3, 0.05, 0.05]
    readings = tuple(Reading(time + 0.01, rows[:, i].copy()) for i in range(4))
    episode = Episode("log", time, command, readings)
    return Study("arm", path, CHANNELS, (episode,), Initial(settle=0.0))


def errors(study: Study, change: Callable[[list[Floats]], list[Floats]]) -> tuple[ColumnError, ...]:
    [episode] = study.episodes
    values = change([reading.value for reading in episode.readings])
    readings = tuple(Reading(r.time, v) for r, v in zip(episode.readings, values, strict=True))
    changed = replace(study, episodes=(replace(episode, readings=readings),))
    with Replayer(changed) as replayer:
        prediction = replayer.replay([]).prediction
        return column_errors(changed, replayer.measured, prediction)


def test_a_heavier_arm_is_no_column_error(study: Study) -> None:
    assert errors(study, lambda values: values) == ()


@pytest.mark.parametrize("channel", range(4))
def test_an_opposite_sign_is_found(study: Study, channel: int) -> None:
    [found] = errors(study, lambda v: [-x if i == channel else x for i, x in enumerate(v)])
    assert (found.kind, found.channel, found.factor) == ("sign", channel, -1.0)
    assert "scale: -1" in found.sentence


@pytest.mark.parametrize(
    ("factor", "words"),
    [(180.0 / np.pi, "degrees"), (np.pi / 180.0, "radians"), (1e3, "thousandths")],
)
def test_a_wrong_unit_is_found(study: Study, factor: float, words: str) -> None:
    found = errors(study, lambda v: [v[0], -factor * v[1], *v[2:]])
    assert [(e.kind, e.channel) for e in found] == [("unit", 1)]
    assert found[0].factor == pytest.approx(-1.0 / factor)
    assert words in found[0].sentence
    assert "opposite sign" in found[0].sentence


def test_swapped_columns_are_found(study: Study) -> None:
    found = errors(study, lambda v: [v[1], v[0], *v[2:]])
    assert {(e.kind, e.channel, e.cycle) for e in found} == {
        ("column", 0, (0, 1)),
        ("column", 1, (0, 1)),
    }
    assert "swapped" in found[0].sentence


@pytest.mark.parametrize("size", [1.0, 1e-9])
def test_columns_are_swapped_only_if_all_of_them_move(study: Study, size: float) -> None:
    """Readings that stand still follow nothing, and their column is no one's."""
    found = errors(study, lambda v: [v[1], size * v[0], *v[2:]])
    assert [e.kind for e in found if e.kind == "column"] == ["column"] * (2 if size == 1.0 else 0)
