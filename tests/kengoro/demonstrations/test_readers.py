"""Minari's and LeRobot's own packages read what was written; each in an environment of its own."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kengoro.demonstrations.minari import NAME
from tests.kengoro.demonstrations.small_dataset import (
    FRAMES,
    STEPS,
    frame_of,
    made_episode,
    write_both,
)
from tests.library_environments import environment

HERE = Path(__file__).parent


def interpreter(config: pytest.Config, *requirements: str) -> Path:
    """The interpreter of an environment with some packages; a variable such as
    ``KENGORO_LEROBOT_PYTHON`` names one that is there."""
    name = requirements[0].split("[")[0].split("~")[0]
    given = os.environ.get(f"KENGORO_{name.upper()}_PYTHON")
    return Path(given) if given else environment(config, *requirements, ours=())


def read(python: Path, script: str, *arguments: Path, **variables: str) -> dict[str, Any]:
    """What a script beside this test prints."""
    done = subprocess.run(
        [python, HERE / script, *arguments],
        env={**os.environ, "PYTHONPATH": "", **variables},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.slow
def test_minari_reads_each_control_step(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    python = interpreter(request.config, "minari[arrow]~=0.5.4", "Pillow")
    write_both(tmp_path / "data")

    root = str(tmp_path / "data" / "minari")
    found = read(python, "read_minari.py", MINARI_DATASETS_PATH=root)

    assert found["name"] == NAME
    assert found["environment"] == "Kengoro/CanGrasp-v0"
    assert found["steps"] == list(STEPS)
    assert found["total"] == sum(STEPS)
    assert all(found["within"])
    for number, steps in enumerate(STEPS):
        episode = made_episode(number)
        np.testing.assert_array_equal(found["lengths"][number], episode.lengths)
        np.testing.assert_array_equal(np.float32(found["actions"][number]), episode.actions)
        np.testing.assert_array_equal(found["rewards"][number], episode.rewards)
        np.testing.assert_array_equal(found["can_pose"][number], episode.can_pose)
        np.testing.assert_array_equal(found["success"][number], episode.success)
        assert found["terminations"][number] == [False] * steps
        assert found["truncations"][number] == [False] * (steps - 1) + [True]
    assert [own["robot"] for own in found["metadata"]] == [5, 5, 6, 6]
    names = [one["departure"] for one in found["robots"]["6"]]
    assert "AttachmentDisplacement" in names
    assert found["metadata"][2]["departures"] == found["robots"]["6"]


@pytest.mark.slow
def test_lerobot_reads_each_frame_with_its_row(
    request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    python = interpreter(request.config, "lerobot~=0.4.4")
    write_both(tmp_path / "data")

    found = read(
        python,
        "read_lerobot.py",
        tmp_path / "data" / "lerobot",
        HF_HUB_OFFLINE="1",
        HF_HOME=str(tmp_path / "home"),
    )

    assert (found["episodes"], found["fps"]) == (4, 5)
    assert found["shape"] == [3, 480, 640]
    assert found["task"] == "Take the can from the table and lift it."
    assert found["episode"] == [i for i, count in enumerate(FRAMES) for _ in range(count)]
    greys = [frame_of(i, row).mean() for i, count in enumerate(FRAMES) for row in range(count)]
    np.testing.assert_allclose(found["grey"], greys, atol=2.0)
    np.testing.assert_allclose(255 * np.array(found["pixel_mean"]), np.mean(greys), atol=1e-6)
    index = 0
    for number, count in enumerate(FRAMES):
        episode = made_episode(number)
        for row in range(count):
            begin, end = 10 * row, min(10 * (row + 1), len(episode))
            state = np.append(episode.lengths[begin], episode.tensions[begin])
            np.testing.assert_allclose(found["state"][index], state, rtol=1e-6)
            pose = [*episode.can_pose[begin, :3, 3], 0, 0, 0, 1]
            np.testing.assert_allclose(found["can"][index], pose, atol=1e-6)
            np.testing.assert_array_equal(
                np.float32(found["action"][index][0]), episode.actions[end - 1]
            )
            assert found["padded"][index] == [False, row == count - 1]
            mean = episode.rewards[begin:end].mean()
            np.testing.assert_allclose(found["reward"][index], mean, rtol=1e-6)
            assert found["done"][index] == (row == count - 1)
            assert found["success"][index] == episode.success[end]  # at the end of the row
            index += 1
