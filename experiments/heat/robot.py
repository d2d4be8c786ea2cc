"""Robots whose motors heat: logs of their tensions, and movements with warm motors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from jmm_agent.heat.parameters import HeatOptions, ThermalParameters
from jmm_agent.observation import SensorReadings
from jmm_agent.options import AgentOptions
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.robots import NO_END, shuffled_postures
from kengoro.session import Session
from kengoro_env.departures import HeatingMotors, actual

HEAT = 6e-4
"""Joule loss per square of the tension [W/N^2]: a motor holds about 105 N forever."""
OPTIONS = HeatOptions(nominal=ThermalParameters(heat_per_tension=HEAT))
"""What the agent knows of the motors by their data sheet."""
PERIOD = 0.05
"""Control period of the robot [s]."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        learned: number of postures of the log, while the map is learned.
        logged: number of postures after them whose tensions are logged.
        hours: duration of the plans that repeat the log [h].
        fault_after: time at which parameters change in the plan with faults [s].
        fault_for: duration of that plan after it [s].
        compared: number of postures with warm motors, with and without the limit.
        move: duration of a movement [s].
        hold: duration of a rest [s].
        whole: duration of the closed loop in one run [h], on robots whose seed is a multiple of 10.
    """

    learned: int = 12
    logged: int = 12
    hours: float = 3.0
    fault_after: float = 3600.0
    fault_for: float = 900.0
    compared: int = 15
    move: float = 2.0
    hold: float = 4.0
    whole: float = 3.0


QUICK = Sizes(2, 2, 0.2, 500.0, 100.0, 2, 0.8, 1.2, 0.005)


@dataclass(frozen=True)
class TensionLog:
    """Tensions of a robot that moves and rests, at one row a second.

    Attributes:
        moving: root mean square of each second (K, m) [N].
        held: mean of the last second of each rest (k, m) [N].
    """

    moving: Floats
    held: Floats


class WarmRobot:
    """A robot with an agent that learned a few postures without a camera's marker observations.

    Args:
        seed: of the robot.
        sizes: amount of work.
        cache: folder of trained maps.
        limited: whether the agent limits tensions by heat.
    """

    def __init__(self, seed: int, sizes: Sizes, cache: Path | None, limited: bool) -> None:
        self._sizes = sizes
        self.postures = shuffled_postures(seed)
        departures = (*actual(seed), HeatingMotors(heat=HEAT, seed=seed))
        env = gym.make(
            "Kengoro/Posture-v0",
            departures=departures,
            camera=False,
            max_episode_steps=NO_END,
            control_period=PERIOD,
        )
        options = AgentOptions(camera="", heat=OPTIONS if limited else None)
        agent = make_agent(seed, options=options, cache=cache)
        start = {"posture": self.postures[0], "target": self.postures[0]}
        self.session = Session(env, agent, seed, None, start)
        self.motors = self.session.world.robot.heat
        assert self.motors is not None

    def visit(self, postures: Floats) -> Floats:
        """Errors target - true of the joint angles at rests (K, n) [rad]."""
        found = []
        for posture in postures:
            self.session.move(posture, self._sizes.move)
            self.session.wait(self._sizes.hold)
            found.append(posture - self.session.truth["joint_angles"])
        return np.array(found)

    def log(self) -> TensionLog:
        """Learn some postures, and log the tensions at the next."""
        sizes = self._sizes
        self.visit(self.postures[1 : 1 + sizes.learned])
        begin = len(self.session.log.tensions)
        chosen = self.postures[1 + sizes.learned : 1 + sizes.learned + sizes.logged]
        self.visit(chosen)
        tensions = np.array(self.session.log.tensions[begin:])
        second = round(1.0 / PERIOD)
        whole = tensions[: len(tensions) // second * second].reshape(-1, second, tensions.shape[1])
        moving = np.sqrt((whole**2).mean(axis=1))
        each = len(tensions) // sizes.logged
        held = np.array(
            [tensions[(k + 1) * each - second : (k + 1) * each].mean(0) for k in range(len(chosen))]
        )
        return TensionLog(moving, held)


def warmed(robot: WarmRobot, log: TensionLog) -> None:
    """Warm motors up by an hour of a log between two control steps, while the arm rests.

    The agent is given the readings of that hour, at one a second, and has learned the motors as far
    as a robot that has moved for an hour. Their time ends with the present time.
    """
    motors, monitor = robot.motors, robot.session.agent.heat
    assert motors is not None
    now = robot.session.time
    if monitor is not None:
        monitor.reset()
    for second in range(-3600, 0):
        tensions = log.moving[second % len(log.moving)]
        if monitor is not None:
            readings = motors.readings
            monitor.update(_readings(now + second, tensions, readings))
            tensions = np.minimum(tensions, monitor.tension_limits())
        motors.advance(tensions, 1.0)


def compared(
    seed: int, sizes: Sizes, cache: Path | None, log: TensionLog, limited: bool
) -> dict[str, Any]:
    """Posture errors of a robot with warm motors.

    Args:
        seed: of the robot.
        sizes: amount of work.
        cache: folder of trained maps.
        log: that the motors are warmed up by.
        limited: whether heat limits tensions.
    """
    robot = WarmRobot(seed, sizes, cache, limited)
    robot.visit(robot.postures[1 : 1 + sizes.learned])
    warmed(robot, log)
    begin = 1 + sizes.learned + sizes.logged
    errors, hottest, cut = [], -np.inf, 0
    assert robot.motors is not None
    for posture in robot.postures[begin : begin + sizes.compared]:
        errors.append(robot.visit(posture[None])[0])
        hottest = max(hottest, float(robot.motors.core.max()))
        monitor = robot.session.agent.heat
        cut += 0 if monitor is None else int(monitor.limited.any())
    robot.session.env.close()
    return {
        "error_deg": float(np.degrees(np.sqrt(np.mean(np.square(errors))))),
        "hottest": hottest,
        "postures_cut": cut,
    }


def whole_loop(seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Hours of moving and resting in one closed loop, without any shortcut.

    Twenty minutes of movements alternate with five minutes at one posture.
    """
    robot = WarmRobot(seed, sizes, cache, limited=True)
    session, motors, monitor = robot.session, robot.motors, robot.session.agent.heat
    assert motors is not None
    assert monitor is not None
    rows, names, number, end = [], set[tuple[str, str]](), 0, 3600.0 * sizes.whole
    error: list[float] = []
    while session.time < end:
        number += 1
        posture = robot.postures[number % len(robot.postures)]
        session.move(posture, sizes.move)
        resting = session.time % 1500.0 > 1200.0
        for _ in range(round((300.0 if resting else sizes.hold) / sizes.hold)):
            session.wait(sizes.hold)
            core = monitor.core
            wrong = float(np.sqrt(np.mean((core.mean - motors.core) ** 2)))
            over = float((motors.core - core.high).max())
            cut = int(monitor.limited.sum())
            rows.append([session.time, float(motors.core.max()), wrong, over, cut])
            names |= {(fault.kind, fault.where) for fault in session.agent.faults}
        angles = posture - session.truth["joint_angles"]
        error.append(float(np.degrees(np.sqrt(np.mean(angles**2)))))
    session.env.close()
    table = np.array(rows)
    late = table[:, 0] > 0.5 * end
    return {
        "hours": sizes.whole,
        "postures": number,
        "hottest": float(table[:, 1].max()),
        "core_error_K": float(np.sqrt(np.mean(table[late, 2] ** 2))),
        "above_interval_K": float(table[:, 3].max()),
        "cut_share": float((table[:, 4] > 0).mean()),
        "error_deg": float(np.median(error)),
        "named": sorted(f"{kind} {where}" for kind, where in names if kind == "heat_changed"),
        "rows": table[:: max(1, len(table) // 500)].round(3).tolist(),
    }


def _readings(time: float, tensions: Floats, temperatures: Floats) -> SensorReadings:
    return SensorReadings(time, np.zeros_like(tensions), tensions, temperatures=temperatures)
