"""Commissioning run of a robot through its driver, before an agent drives it."""

from __future__ import annotations

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.commissioning.commissioning import Commissioner, Commissioning
from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.driving.call_watch import CallWatch
from jmm_agent.driving.drive import DriveOptions, LostReadingsError, Watcher
from jmm_agent.driving.driver import Driver, PausingDriver, check_methods
from jmm_agent.driving.emergency_stop import EmergencyStop
from jmm_agent.driving.endings import endings_raised
from jmm_agent.driving.lost_readings import why_lost
from jmm_agent.driving.robot_stop import RobotStop
from jmm_agent.driving.short_pauses import short_pauses
from jmm_agent.errors import AgentError
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats


def commissioner_of(
    agent: Agent,
    posture: Floats | None = None,
    options: CommissionOptions | None = None,
    held: Floats | None = None,
) -> Commissioner:
    """Commissioner of the robot that an agent is made for.

    Args:
        agent: knows the nominal map, the joint limits and the motors; it is not changed.
        posture: joint angles (n,) [rad] at which the robot is, about; where the agent believes to
            start if left out.
        options: how muscles are pulled; the defaults if left out.
        held: target lengths (m,) [m] that the motors hold now; the first readings if left out.

    Raises:
        AgentError: the motors are unknown, the agent has an order of muscles already, or an
            argument is not valid.
    """
    if agent.motors is None:
        raise AgentError(
            "commission: the gains and the limit of the motors are unknown; set Agent.motors."
        )
    if agent.order is not None:
        raise AgentError(
            "commission: the agent has an order of muscles from an earlier run; use one without."
        )
    posture = agent.target if posture is None else posture
    limits, motors = agent.kinematics.limits, agent.motors
    return Commissioner(agent.nominal_map, limits, posture, motors, options, held)


def commission(
    agent: Agent,
    driver: Driver,
    posture: Floats | None = None,
    options: CommissionOptions | None = None,
    held: Floats | None = None,
    watch: Watcher = lambda readings, target_lengths: None,
    drive_options: DriveOptions | None = None,
    emergency_stop: EmergencyStop | None = None,
) -> Commissioning:
    """Pull each muscle a little, and name what does not fit the nominal map.

    The robot is near a posture and its muscles hold it; it needs room to move by some degrees. The
    last command holds the robot; the caller calls `Driver.stop` at the very end. Here it is called
    after any error.

    Args:
        agent: of the nominal model; it is not changed.
        driver: the robot.
        posture: joint angles (n,) [rad] at which the robot is, about; where the agent believes to
            start if left out.
        options: how muscles are pulled; the defaults if left out.
        held: target lengths (m,) [m] that the motors hold now; the first readings if left out.
        watch: called with the readings and the target lengths (m,) [m] after every step.
        drive_options: what is tolerated; only ``timeout`` and ``lost`` count.
        emergency_stop: ends the run when it is triggered, also from another thread.

    Raises:
        AgentError: driver, arguments or readings cannot be used; the robot was stopped.
    """
    stop, emergency_stop = RobotStop(driver), emergency_stop or EmergencyStop()
    with endings_raised(), short_pauses():
        try:
            check_methods(driver)
            emergency_stop.check()
            commissioner = commissioner_of(agent, posture, options, held)
            tolerated = drive_options or DriveOptions()
            with CallWatch(stop, tolerated.timeout, emergency_stop) as calls:
                loop = _Loop(commissioner, driver, tolerated.lost, calls, emergency_stop)
                loop.run(watch)
            result = commissioner.result()
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                emergency_stop.trigger("the commissioning run was interrupted (Ctrl-C)")
            stop.after(error)
            raise
        if isinstance(driver, PausingDriver):
            driver.pause()
        return result


class _Loop:
    """Control periods of one run."""

    def __init__(
        self,
        commissioner: Commissioner,
        driver: Driver,
        tolerated: int,
        calls: CallWatch,
        emergency_stop: EmergencyStop,
    ) -> None:
        self._commissioner, self._driver, self._tolerated = commissioner, driver, tolerated
        self._calls, self._emergency_stop = calls, emergency_stop
        self._begun, self._in_a_row = False, 0
        self._last_time = -np.inf

    def run(self, watch: Watcher) -> None:
        """Run control periods until the commissioner is done."""
        command: Floats | None = None
        while not self._commissioner.done:
            readings = self._read()
            if readings is not None:
                if not self._begun and self._commissioner.refuse(readings):
                    return
                self._begun = True
                command = self._commissioner.step(readings)
                watch(readings, command)
            self._emergency_stop.check()
            if command is not None:
                self._calls.begin("write")
                self._driver.write(command)
                self._calls.end()

    def _read(self) -> SensorReadings | None:
        """Readings that can be used; None for a control period without."""
        self._calls.begin("read")
        readings = self._driver.read()
        self._calls.end()
        reason = why_lost(readings, gaps=True)
        if readings is not None and not reason and readings.time == self._last_time:
            reason = "their time is that of the readings before"
        if readings is None or reason:
            self._in_a_row += 1
            if self._in_a_row >= self._tolerated:
                raise LostReadingsError(
                    f"No usable readings in {self._in_a_row} control periods in a row ({reason}); "
                    "the robot was stopped. DriveOptions.lost is the number that ends a run."
                )
            return None
        self._in_a_row, self._last_time = 0, readings.time
        return readings
