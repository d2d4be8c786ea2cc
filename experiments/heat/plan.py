"""Hours of tensions from a short log, the heat that they make, and what an agent knows of it.

The physics of the arm is not simulated here: tensions are those of a log, repeated in another order
and cut to the limits that the agent sets. The heat of the motors is integrated exactly. Twenty
minutes of movements alternate with ten minutes in which two postures are held.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.heat.robot import HEAT, OPTIONS, Sizes, TensionLog
from jmm_agent.guard.faults import HEAT_CHANGED, MotorControl
from jmm_agent.heat.heat_monitor import HeatMonitor
from jmm_agent.heat.parameters import HeatOptions
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from kengoro_env.departures import HeatingMotors
from kengoro_env.robot.draft import Draft, TendonSpec
from kengoro_env.robot.motor_heat import MotorHeat

NOISE = 1.0
"""Standard deviation of a tension reading [N]."""
WARM = 20.0
"""Rise of a core over its surroundings from which on its errors count [K]."""
HOUSING, HEATING, CORE = "housing_to_ambient", "heat_per_tension", "core_to_housing"
CHANGES = ((HOUSING, 1.25), (HEATING, 1.25), (HOUSING, 0.8), (HEATING, 0.8), (CORE, 1.25))
"""Parameters that change, and their factors; in turn from the motor with the warmest housing on."""
FAULTY = 10
"""Number of motors with a change."""


def planned(log: TensionLog, seconds: float, seed: int) -> Floats:
    """Tensions at one row a second (K, m) [N].

    Args:
        log: that they are taken from.
        seconds: duration [s].
        seed: of the order.
    """
    rng, rows = np.random.default_rng([seed, 361]), list[Floats]()
    count = 0
    while count < seconds:
        for _ in range(-(-1200 // len(log.moving))):
            rows.append(np.roll(log.moving, rng.integers(len(log.moving)), axis=0))
        for posture in rng.permutation(len(log.held))[:2]:
            rows.append(np.tile(log.held[posture], (300, 1)))
        count = sum(map(len, rows))
    return np.concatenate(rows)[: round(seconds)]


def motors_of(seed: int, muscles: int, **other: float) -> MotorHeat:
    """The motors of a robot, without the robot.

    Args:
        seed: of the robot.
        muscles: number of muscles.
        **other: fields of `HeatingMotors`.
    """
    names = [f"muscle_{number}" for number in range(muscles)]
    draft = Draft(None, {name: TendonSpec() for name in names})
    HeatingMotors(heat=HEAT, seed=seed, **other).edit(draft)
    assert draft.heat is not None
    motors = MotorHeat(draft.heat)
    motors.reset(np.random.default_rng([seed, 362]))
    return motors


class Trial:
    """Motors and an agent's monitor, second by second.

    Args:
        motors: that heat.
        seed: of the noise.
        options: of the monitor.

    Attributes:
        monitor: estimates and limits.
        hottest: highest core temperature so far [degC].
        named: changes by muscle: time at which it was named first [s], and its detail.
    """

    def __init__(self, motors: MotorHeat, seed: int, options: HeatOptions = OPTIONS) -> None:
        self.motors = motors
        self.monitor = HeatMonitor(motors.muscles, MotorControl(), options)
        self.hottest = -np.inf
        self.named: dict[str, tuple[float, str]] = {}
        self._rng = np.random.default_rng([seed, 363])
        self._tensions = np.zeros(len(motors.muscles))

    def step(self, tensions: Floats) -> None:
        """Pull for a second with tensions (m,) [N], cut to the limits."""
        noise = NOISE * self._rng.standard_normal(len(tensions))
        read = np.maximum(0.0, self._tensions + noise)
        time, temperatures = self.motors.time, self.motors.readings
        self.monitor.update(
            SensorReadings(time, np.zeros_like(read), read, temperatures=temperatures)
        )
        self._tensions = np.minimum(tensions, self.monitor.tension_limits())
        self.motors.advance(self._tensions, 1.0)
        self.hottest = max(self.hottest, float(self.motors.core.max()))
        for fault in self.monitor.faults:
            if fault.kind == HEAT_CHANGED:
                self.named.setdefault(fault.where, (time, fault.detail))


def healthy(log: TensionLog, seed: int, sizes: Sizes) -> dict[str, Any]:
    """Hours of a plan on healthy motors: errors with and without learning, and false names."""
    tensions = planned(log, 3600.0 * sizes.hours, seed)
    trial = Trial(motors_of(seed, tensions.shape[1]), seed)
    fixed = HeatMonitor(trial.motors.muscles, MotorControl(), OPTIONS)
    unlimited = motors_of(seed, tensions.shape[1])
    free, rows = -np.inf, list[Floats]()
    for second, wanted in enumerate(tensions):
        trial.step(wanted)
        unlimited.advance(wanted, 1.0)
        free = max(free, float(unlimited.core.max()))
        pulled = np.minimum(wanted, trial.monitor.tension_limits())
        fixed.update(SensorReadings(float(second), np.zeros_like(pulled), pulled))
        if second % 10 == 9:
            core = trial.monitor.core
            rows.append(np.stack([trial.motors.core, core.mean, core.high, fixed.core.mean]))
    table = np.array(rows)
    true, mean, high, nominal = np.moveaxis(table, 1, 0)
    warm = (true > trial.motors.ambient + WARM) & (np.arange(len(true)) >= 6)[:, None]
    late = warm & (np.arange(len(true)) > 2 * len(true) // 3)[:, None]
    motor = int(true.max(axis=0).argmax())
    return {
        "hours": sizes.hours,
        "hottest": trial.hottest,
        "hottest_without_limit": free,
        "error_nominal_K": _rms((nominal - true)[late]),
        "error_first_K": _rms((mean - true)[warm & (np.arange(len(true)) < 120)[:, None]]),
        "error_learned_K": _rms((mean - true)[late]),
        "inside": float(np.mean(np.abs(true - mean)[warm] <= (high - mean)[warm]))
        if warm.any()
        else 1.0,
        "wide_K": float(np.median((high - mean)[late])) if late.any() else 0.0,
        "false_names": len(trial.named),
        "curves": table[:: max(1, len(table) // 300), :, motor].round(2).tolist(),
    }


def faulty(log: TensionLog, seed: int, sizes: Sizes) -> list[dict[str, Any]]:
    """Parameters of the motors with the warmest housings change; when each is named."""
    begin = round(sizes.fault_after)
    tensions = planned(log, begin + sizes.fault_for, seed)
    trial = Trial(motors_of(seed, tensions.shape[1]), seed)
    changed: list[tuple[int, str, float, float]] = []
    for second, wanted in enumerate(tensions):
        if second == begin:
            warmest = np.argsort(trial.motors.housing)[::-1][:FAULTY]
            for number, motor in enumerate(warmest):
                parameter, factor = CHANGES[number % len(CHANGES)]
                rise = float(trial.motors.housing[motor] - trial.motors.ambient)
                trial.motors.change(trial.motors.muscles[motor], parameter, factor)
                changed.append((int(motor), parameter, factor, rise))
        trial.step(wanted)
    found = []
    for motor, parameter, factor, rise in changed:
        time, detail = trial.named.get(trial.motors.muscles[motor], (np.inf, ""))
        known = time >= begin and np.isfinite(time)
        which = detail.split(" of ")[0]
        found.append(
            {
                "parameter": parameter,
                "factor": factor,
                "rise_K": rise,
                "minutes": (time - begin) / 60.0 if known else None,
                "right": parameter in which if known else None,
                "alone": which == parameter if known else None,
            }
        )
    muscles = {trial.motors.muscles[motor] for motor, *_ in changed}
    others = {"false_names": len(set(trial.named) - muscles), "hottest": trial.hottest}
    return [{**entry, **others} for entry in found]


def _rms(errors: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(errors)))) if errors.size else 0.0
