"""`kengoro calibrate`: each fault of a robot is said in one sentence, and none where there is none.

The robot of most tests is a stand-in: muscles that shorten when they are pulled, without an arm.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.other_robots.models import write_model
from jmm_agent.guard.faults import MotorControl
from jmm_agent.observation import SensorReadings
from jmm_agent.vision.camera import Camera
from kengoro.calibration.calibration_file import Calibration, load_calibration
from kengoro.calibration.checks import RobotChecks, camera_problems, length_problems
from kengoro.commands import calibrate as calibrate_module
from kengoro.commands.calibrate import Args, calibrate
from kengoro.errors import UsageError

MUSCLES = ("a", "b", "c")
MOTORS = MotorControl(30_000.0, 30.0, 500.0)


class Muscles:
    """Driver of muscles that shorten by half of what they are pulled.

    Args:
        signs: -1 for an encoder with the wrong sign.
        gain: stiffness as a share of the given one.
        sensors: factor of the tension sensors.
        dead: muscle whose motor does nothing.
        steps: time steps in turn [s].
    """

    def __init__(
        self,
        signs: tuple[int, ...] = (1, 1, 1),
        gain: float = 1.0,
        sensors: tuple[float, ...] = (1.0, 1.0, 1.0),
        dead: int | None = None,
        steps: tuple[float, ...] = (0.02,),
    ) -> None:
        self._signs, self._gain, self._sensors = np.array(signs), gain, np.array(sensors)
        self._dead, self._steps = dead, steps
        self._rng = np.random.default_rng(0)
        self._rest = np.array([0.01, -0.02, 0.0])
        self._pull, self._time, self._count = np.zeros(3), 1.7e9, 0

    def read(self) -> SensorReadings | None:
        self._count += 1
        if self._count % 40 == 0:
            return None
        self._time += self._steps[self._count % len(self._steps)]
        noise = 2e-5 * self._rng.standard_normal(3)
        lengths = self._rest - 0.5 * self._signs * self._pull + noise
        tensions = 30.0 + 30_000.0 * self._gain * 0.5 * self._pull
        return SensorReadings(self._time, lengths, self._sensors * tensions)

    def write(self, target_lengths: np.ndarray) -> None:
        self._pull = np.maximum(0.0, self._rest - target_lengths)
        self._pull[self._pull < 2e-4] = 0.0
        if self._dead is not None:
            self._pull[self._dead] = 0.0

    def stop(self) -> None:
        """Do nothing."""


def problems(**wrong: Any) -> list[str]:
    checks = RobotChecks(Muscles(**wrong), MUSCLES, MOTORS, lambda _: None)
    return [*checks.clock(1.0), *checks.pulls(30.0)]


def test_a_robot_without_a_fault_is_reported_as_right() -> None:
    assert problems() == []
    assert problems(steps=(0.016, 0.02, 0.024)) == []


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"signs": (1, -1, 1)}, r"b lengthens by 0\.5\d? mm when it is pulled"),
        ({"dead": 2}, "c neither shortens nor pulls"),
        ({"sensors": (0.0, 1.0, 1.0)}, "The tension of a is 0 N while it is pulled"),
        ({"sensors": (1.0, -1.0, 1.0)}, "The tension of b is -45 N while it is pulled"),
        ({"gain": 3.0}, r"K_stiff is (8\.[5-9]\d*|9(\.[0-5]\d*)?)e\+04 N/m"),
        ({"steps": (0.2,)}, "The control period is 200 ms, but must be 5 to 50 ms"),
        ({"steps": (20.0,)}, "are the stamps in seconds"),
        ({"steps": (0.03, -0.01, 0.03, 0.03)}, "time stamps are not later than the last"),
        ({"steps": (0.01,) * 9 + (0.1,)}, "cycles were lost or late"),
        ({"steps": (0.006, 0.02, 0.024)}, "The period varies by"),
    ],
)  # fmt: skip
def test_each_fault_is_named_in_one_sentence(wrong: dict[str, Any], sentence: str) -> None:
    found = problems(**wrong)
    assert len(found) == 1, found
    assert re.search(sentence, found[0])
    assert found[0][-1] in ".?"


def test_lengths_that_were_not_zeroed_are_named() -> None:
    checks = RobotChecks(Muscles(), MUSCLES, MOTORS, lambda _: None)
    (sentence,) = checks.zero(0.015)
    assert sentence.startswith("In the zero posture 1 of 3 lengths are farther than 15 mm from")
    assert "b by -20 mm" in sentence
    assert checks.zero(0.03) == []


def test_lengths_in_millimetres_are_named() -> None:
    nominal = np.array([[0.0, 0.0, 0.0], [0.03, -0.02, 0.01]])
    assert length_problems(np.array([0.05, -0.05, 0.02]), nominal, MUSCLES) == []
    (sentence,) = length_problems(np.array([20.0, -30.0, 4.0]), nominal, MUSCLES)
    assert sentence.startswith("b has a length of -30 m, but -0.02 to 0 m by the nominal model")
    assert "are lengths in metres" in sentence


def test_a_length_that_is_no_number_hides_no_other() -> None:
    nominal = np.array([[0.0, 0.0, 0.0], [0.03, -0.02, 0.01]])
    dead, far = length_problems(np.array([np.nan, -30.0, 0.02]), nominal, MUSCLES)
    assert dead == "The length of a is no number: is the encoder connected?"
    assert far.startswith("b has a length of -30 m")


def test_without_increasing_stamps_the_file_has_no_period(tmp_path: Path) -> None:
    checks = RobotChecks(Muscles(steps=(0.0,)), MUSCLES, MOTORS, lambda _: None)
    assert checks.clock() == ["The time stamps do not increase; they must be seconds."]
    assert checks.period is checks.jitter is None
    assert checks.pulls(30.0) == []  # at the usual control period


def test_a_scene_without_a_camera_and_units_of_a_driver_are_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    scene = tmp_path / "finger.xml"
    text = write_model("planar-finger", tmp_path).read_text()
    scene.write_text(re.sub(r"<camera.*?/>", "", text))

    class Millimetres(Muscles):
        def read(self) -> SensorReadings | None:
            readings = super().read()
            if readings is None:
                return None
            lengths, tensions = np.full(4, 4.0), np.full(4, 30.0)
            return readings._replace(time=readings.time, lengths=lengths, tensions=tensions)

        def write(self, target_lengths: np.ndarray) -> None:
            """Do nothing."""

    monkeypatch.setattr(calibrate_module, "RemoteRobot", lambda port, host: Millimetres())
    found = calibrate(Args(port=1, scene=scene, pull=0.0), False, lambda _: None)
    assert any("are lengths in metres" in problem for problem in found.problems)
    assert "The model has no camera 'eye': give --camera." in found.problems


def test_another_number_of_muscles_is_refused() -> None:
    with pytest.raises(UsageError, match="sends 3 lengths, but its nominal model has 2 muscles"):
        RobotChecks(Muscles(), MUSCLES[:2], MOTORS, lambda _: None)


def test_frames_of_another_size_and_a_missing_marker_are_named() -> None:
    camera = Camera.from_fovy(640, 480, 0.8)
    readings = SensorReadings(1.0, np.zeros(3), np.zeros(3), None, 0.9)
    assert "no frame" in camera_problems(readings, camera, 0, 0.05)[0]
    small = readings._replace(frame=np.full((240, 320, 3), 90, np.uint8))
    assert "Frames are 320 x 240" in camera_problems(small, camera, 0, 0.05)[0]
    empty = readings._replace(frame=np.full((480, 640, 3), 90, np.uint8), frame_time=2.0)
    time, marker = camera_problems(empty, camera, 0, 0.05)
    assert "time" in time
    assert marker.startswith("Marker 0 has no pose: the marker is not in the frame")


def test_a_calibration_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "here" / "calibration.json"
    written = Calibration(None, None, 3, 0.04, 1e4, 20.0, 300.0, True, 0.01, 0.0, ("a is wrong.",))
    written.save(path)
    assert load_calibration(path) == written
    assert written.motors == MotorControl(1e4, 20.0, 300.0)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"stiffness": -1}, "stiffness is -1"),
        ({"stiffness": True}, "stiffness is True"),
        ({"bias": 600.0}, "above the limit"),
        ({"marker": 0.5}, "marker is 0.5"),
        ({"camera": 3}, "camera is 3"),
        ({"problems": "none"}, "problems is 'none'"),
        ({"speed": 1.0}, "'speed' is unknown"),
        ({"format": "other"}, "its format is not"),
    ],
)
def test_a_file_that_is_no_calibration_is_refused(
    change: dict[str, Any], reason: str, tmp_path: Path
) -> None:
    path = tmp_path / "calibration.json"
    Calibration().save(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(UsageError, match=reason):
        load_calibration(path)


@pytest.mark.parametrize("content", ["", "[]", "{", "\x00", '{"format": ' + "[" * 5000])
def test_a_damaged_file_is_refused(content: str, tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    path.write_text(content)
    with pytest.raises(UsageError, match="holds no calibration"):
        load_calibration(path)
    with pytest.raises(UsageError, match="holds no calibration"):
        load_calibration(tmp_path / "missing.json")


def test_the_simulated_robot_is_calibrated_without_questions(tmp_path: Path) -> None:
    args = Args(out=tmp_path / "calibration.json", pull=0.0, marker_side=0.05)
    found = calibrate(args, False, lambda _: None)
    assert found.problems == ()
    assert found.period == pytest.approx(0.02)
    assert (found.stiffness, found.bias, found.limit) == (30_000.0, 30.0, 500.0)


def test_what_was_left_out_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["", "0.04", "x", "20000", "", "", "maybe", "n", "0"])
    monkeypatch.setattr("builtins.input", lambda text: next(answers))
    found = calibrate(Args(), True, lambda _: None)
    assert (found.marker_side, found.stiffness, found.zeroed) == (0.04, 20_000.0, False)
    assert next(answers, None) is None


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"marker_side": 0.0}, "marker_side is 0 m"),
        ({"marker": -1}, "marker is -1"),
        ({"bias": 900.0}, "above the limit"),
        ({"pull": -1.0}, "pull is -1 N"),
        ({"robot": -2}, "seeds are not negative"),
        ({"camera": Path("missing.yaml")}, "missing.yaml"),
    ],
)
def test_options_that_do_not_fit_are_refused(wrong: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        calibrate(replace(Args(pull=0.0), **wrong), False, lambda _: None)
