"""Warnings on models whose time step is too coarse, or whose parts touch."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.simulation.replay_warnings import replay_warnings
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from tests.reality_gap.arm_logs import ARM, motion


def study_of(folder: Path, model: str, noise: float = 1e-3) -> Study:
    path = folder / "arm.xml"
    sensors = "".join(
        f'<jointpos name="{name}" joint="{name}"/>' for name in ("shoulder_pan", "elbow_flex")
    )
    named = model.replace("<position joint=", "<position name=")
    for name in ("shoulder_pan", "elbow_flex"):
        named = named.replace(f'<position name="{name}"', f'<position name="{name}" joint="{name}"')
    path.write_text(named.replace("</mujoco>", f"<sensor>{sensors}</sensor></mujoco>"))
    time, command, angles = motion()
    channels = tuple(
        Channel(name, name, 0, "rad", noise) for name in ("shoulder_pan", "elbow_flex")
    )
    readings = tuple(Reading(time, column) for column in angles.T)
    episode = Episode("log", time, command, readings)
    return Study("arm", path, channels, (episode,), Initial({}, 0.0))


def test_a_fine_step_and_no_contact_are_not_mentioned(tmp_path: Path) -> None:
    assert replay_warnings(study_of(tmp_path, ARM)) == []


def test_a_coarse_step_is_named_with_a_finer_one(tmp_path: Path) -> None:
    coarse = ARM.replace('timestep="0.002"', 'timestep="0.008"')
    noise = 2e-4  # of which errors are many, although they vanish with finer steps
    [sentence] = replay_warnings(study_of(tmp_path, coarse, noise))
    assert "time step of 8 ms" in sentence
    finer = float(sentence.split("timestep=")[1].split(" ")[0])
    again = tmp_path / "finer"
    again.mkdir()
    assert replay_warnings(study_of(again, ARM.replace("0.002", str(finer)), noise)) == []


def test_a_coarse_step_below_the_noise_is_not_mentioned(tmp_path: Path) -> None:
    coarse = ARM.replace('timestep="0.002"', 'timestep="0.008"')
    assert replay_warnings(study_of(tmp_path, coarse, noise=0.1)) == []


def test_a_link_that_touches_what_is_fixed_to_the_world_is_named(tmp_path: Path) -> None:
    stand = '<body name="stand"><geom fromto="0 0.01 0 0.1 0.01 0" contype="1"/></body>'
    touching = ARM.replace("<worldbody>", f"<worldbody>{stand}")
    sentences = replay_warnings(study_of(tmp_path, touching, noise=1.0))
    [sentence] = (s for s in sentences if "touch" in s)
    assert "stand and upper" in sentence
    assert "stand is fixed to the world" in sentence
    exclude = sentence.split("add ")[1]
    again = tmp_path / "excluded"
    again.mkdir()
    free = touching.replace("</worldbody>", f"</worldbody><contact>{exclude}</contact>")
    assert not [s for s in replay_warnings(study_of(again, free, noise=1.0)) if "touch" in s]


def test_only_the_first_seconds_are_replayed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A check of a long log takes no longer than that of a short one."""
    study = study_of(tmp_path, ARM)
    [episode] = study.episodes
    time = 0.02 * np.arange(5000)
    long = replace(
        episode,
        time=time,
        command=np.tile(episode.command, (25, 1)),
        readings=tuple(Reading(time, np.tile(r.value, 25)) for r in episode.readings),
    )
    steps = list[int]()
    rollout = mujoco.rollout.rollout

    def counted(model: object, data: object, state: object, control: np.ndarray, **more: object):
        steps.append(control.shape[1])
        return rollout(model, data, state, control, **more)

    monkeypatch.setattr(mujoco.rollout, "rollout", counted)
    replay_warnings(replace(study, episodes=(long,)))
    assert max(steps) * 0.0005 <= 6.0
