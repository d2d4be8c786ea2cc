"""Joint-muscle map: training time, errors of lengths and Jacobians, and time of a call."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from jmm_agent.mapping.training import train
from kengoro.trained_maps import nominal_model
from kengoro_env.assets import asset_path
from kengoro_env.robot.nominal_model import NominalArm

POSTURES = 1000
"""Random postures at which the errors are computed."""

CALLS = 300
"""Timed calls."""


def rms(array: NDArray[np.float64]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.square(array).mean()))


def microseconds(call: Callable[[], object]) -> tuple[float, float]:
    """Median and 99th percentile of the time of a call [us]."""
    times = np.empty(CALLS)
    for k in range(CALLS):
        begin = time.perf_counter()
        call()
        times[k] = time.perf_counter() - begin
    return float(np.median(times) * 1e6), float(np.percentile(times, 99) * 1e6)


def main() -> None:
    """Train a map on the nominal model of the arm, and print errors and times."""
    source = NominalArm(asset_path("mjcf/kengoro_arm/arm.xml"))
    nominal = nominal_model()
    jmm, report = train(nominal, seed=0)
    postures = np.random.default_rng(1).uniform(
        nominal.lower, nominal.upper, (POSTURES, len(nominal.joints))
    )
    true = np.array([source.moment_arms(posture) for posture in postures])
    analytic, quadratic = jmm.jacobian(postures), jmm.jacobian_quadratic(postures)
    error = jmm.lengths(postures) - source.lengths(postures)

    print(f"Training: {report.seconds:.1f} s")
    print("               RMSE mm               largest   Jacobian RMSE mm/rad")
    print("group       s  training  validation  error mm  true rms  analytic  quadratic")
    for group in jmm.groups:
        training = report.groups[group.name]
        block = (slice(None), group.muscle_index[:, None], group.joint_index)
        largest = np.abs(error[:, group.muscle_index]).max()
        print(
            f"{group.name:<9}{training.seconds:4.1f}  {1e3 * training.training_rmse:8.4f}"
            f"  {1e3 * training.validation_rmse:10.4f}  {1e3 * largest:8.2f}"
            f"  {1e3 * rms(true[block]):8.2f}"
            f"  {1e3 * rms((analytic - true)[block]):8.2f}"
            f"  {1e3 * rms((quadratic - true)[block]):9.2f}"
        )
    q = postures[0]
    print("One posture, all groups                 median us  99 % us")
    for name, call in (
        ("lengths", lambda: jmm.lengths(q)),
        ("lengths and analytic Jacobian", lambda: jmm.lengths_and_jacobian(q)),
        ("quadratic Jacobian", lambda: jmm.jacobian_quadratic(q)),
    ):
        median, high = microseconds(call)
        print(f"{name:<40}{median:9.0f}{high:9.0f}")


if __name__ == "__main__":
    main()
