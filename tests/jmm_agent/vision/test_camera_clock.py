"""The delay of a camera from movements of the marker, and frames exposed while the hand moves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jmm_agent.errors import AgentError
from jmm_agent.vision import camera_delay
from jmm_agent.vision.camera_clock import CameraClock, ExposureClock
from jmm_agent.vision.camera_delay import DelayEstimator

NOISE = 0.003
PERIOD = 0.02


def paths(count: int, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Movements: times (N,) [s] and positions (N, 3) [m], 1 s of motion and 0.8 s of rest each."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.15, 0.15, (count + 1, 2, 3))
    result = []
    for k in range(count):
        times = 1.8 * k + np.arange(0.0, 1.8, PERIOD)
        share = np.clip(times - 1.8 * k, 0.0, 1.0)
        blend = (share**2 * (3.0 - 2.0 * share))[:, None]
        bend = np.sin(np.pi * share)[:, None] * points[k, 1]
        start, end = points[k, 0], points[k + 1, 0]
        result.append((times, start + blend * (end - start) + 0.5 * bend))
    return result


def estimated(
    delay: float,
    seed: int = 0,
    interval: float = 0.2,
    noise: float = 0.002,
    turn: float = 0.3,
    movements: int = 6,
    still: bool = False,
) -> DelayEstimator:
    """What an estimator finds whose expected positions are turned, moved and noisy."""
    rng = np.random.default_rng(seed)
    wrong = Rotation.from_rotvec(turn * rng.normal(size=3) / np.sqrt(3)).as_matrix()
    offset = rng.normal(0, 0.03, 3)
    estimator = DelayEstimator(0.3, NOISE)
    moves = paths(movements, seed)
    all_times = np.concatenate([times for times, _ in moves])
    all_positions = np.concatenate([positions for _, positions in moves])
    if still:
        all_positions = np.tile(all_positions[:1], (len(all_times), 1))
    frame = -1
    for time, position in zip(all_times, all_positions, strict=True):
        estimator.expect(time, wrong @ position * 1.05 + offset + rng.normal(0, noise, 3))
        if int((time - delay) / interval) > frame and time > delay:
            frame = int((time - delay) / interval)
            exact = [np.interp(frame * interval, all_times, c) for c in all_positions.T]
            estimator.add_frame(frame * interval + delay, np.array(exact) + rng.normal(0, 2e-4, 3))
        if time % 1.8 > 1.8 - 1.5 * PERIOD:
            estimator.end_movement()
    return estimator


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.12, 0.25])
@pytest.mark.parametrize("interval", [0.2, 1 / 30])
def test_the_delay_is_found_within_its_uncertainty(delay: float, interval: float) -> None:
    errors, stds = [], []
    for seed in range(5):
        found = estimated(delay, seed, interval).estimate
        assert found.reason == ""
        assert found.movements == 6
        errors.append(found.delay - delay)
        stds.append(found.std)
    assert np.abs(errors).max() < 0.02
    assert np.sqrt(np.mean(np.square(errors))) < 2.0 * np.mean(stds)


def test_without_motion_it_names_the_missing_motion() -> None:
    found = estimated(0.12, still=True).estimate
    assert np.isnan(found.delay)
    assert found.reason == "0 movements were seen in frames, and 3 are needed"
    assert estimated(0.12, movements=2).estimate.movements == 2


def test_a_delay_beyond_the_longest_is_not_used() -> None:
    assert "more than `longest` allows" in estimated(0.5, interval=1 / 30).estimate.reason


def test_an_unknown_delay_is_taken_as_the_longest_until_it_is_estimated() -> None:
    clock = ExposureClock(CameraClock(delay=None, exposure=0.02), NOISE)
    assert clock.middle(10.0) == pytest.approx(10.0 - 0.3 - 0.01)
    assert clock.in_rest(10.0 - 0.3 - 0.02 - 1e-9)
    assert not clock.in_rest(10.0 - 0.3 - 0.01)
    clock.estimator = estimated(0.12, interval=1 / 30)
    assert clock.middle(10.0) == pytest.approx(10.0 - 0.3 - 0.01)  # the same frame
    assert clock.middle(11.0) == pytest.approx(11.0 - 0.12 - 0.01, abs=0.01)


def test_an_exact_stamp_is_kept_to_the_bit() -> None:
    clock = ExposureClock(CameraClock(), NOISE)
    assert not clock.follows
    for stamp in (0.1, 1.7e9 + 0.1234567):
        assert clock.middle(stamp) == stamp
        assert clock.in_rest(stamp)
        assert not clock.in_rest(np.nextafter(stamp, np.inf))


def test_the_rest_must_begin_before_the_exposure() -> None:
    clock = ExposureClock(CameraClock(delay=0.1, exposure=0.03, jitter=0.01), NOISE)
    assert clock.middle(5.0) == pytest.approx(5.0 - 0.1 - 0.015)
    assert clock.in_rest(5.0 - 0.1 - 0.03 - 0.01 - 1e-6)
    assert not clock.in_rest(5.0 - 0.1 - 0.03 - 0.01 + 1e-6)


@pytest.mark.parametrize(("speed", "blurred"), [(0.0, False), (0.02, False), (0.06, True)])
def test_a_hand_that_still_moves_is_blurred(speed: float, blurred: bool) -> None:
    rng = np.random.default_rng(0)
    clock = ExposureClock(CameraClock(exposure=0.03), NOISE)
    for k in range(30):
        clock.expect(PERIOD * k, np.array([speed * PERIOD * k, 0.0, 0.5]) + rng.normal(0, 2e-3, 3))
    assert clock.blurred() is blurred


@pytest.mark.parametrize(
    "wrong", [{"delay": -0.1}, {"exposure": np.nan}, {"jitter": np.inf}, {"longest": 0.0}]
)
def test_numbers_that_no_camera_has_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(AgentError, match=f"CameraClock: {next(iter(wrong))} is"):
        CameraClock(**wrong)


def test_an_estimate_is_computed_once_in_a_movement(monkeypatch: pytest.MonkeyPatch) -> None:
    estimator = estimated(0.12)
    monkeypatch.setattr(camera_delay, "np", None)  # nothing can be computed any more
    assert estimator.precise
    assert estimator.estimate.movements == 6
