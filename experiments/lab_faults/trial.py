"""Trials: an agent drives and learns, and at a random moment something is killed or breaks."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.lab_faults.faulty_connection import (
    ALL_LOST,
    COMMANDS_LOST,
    DELAYED,
    DUPLICATED,
    READINGS_LOST,
    UNPLUGGED,
)
from experiments.lab_faults.processes import Event, Host
from kengoro.remote_robot.server import AGENT, CONNECTION, WATCHDOG
from kengoro.remote_robot.token import VARIABLE, new_token

PATIENCE = 30.0
"""Longest wait for what must come [s]."""
LONG = 1e9
"""Control periods of a fault that does not end by itself."""
GOES_ON = 10
"""Control periods for which a robot is watched that must not stop."""
MOST_ATTEMPTS = 20
"""Most attempts of a trial."""
MOST_PERIODS = 5
"""Most control periods until the robot is stopped."""
NO_ONE = "none"


class Fault(NamedTuple):
    """What is done to the agent, the line or the robot.

    Attributes:
        name: of the fault.
        stops: who must stop the robot: "agent", "watchdog", "connection", or "none".
        number: signal to the agent; None for none.
        line: fault of the line; empty for none.
        periods: its duration.
        half_open: whether the end of the agent's process does not end the connection.
        raises: whether the agent's code fails.
        ends: whether the agent's process must end with a sentence, when it can run.
    """

    name: str
    stops: str
    number: int | None = None
    line: str = ""
    periods: float = LONG
    half_open: bool = False
    raises: bool = False
    ends: bool = False


FAULTS = (
    Fault("packets lost for 2 periods", NO_ONE, line=READINGS_LOST, periods=2),
    Fault("packets 1 period late", NO_ONE, line=DELAYED, periods=10),
    Fault("packets duplicated", NO_ONE, line=DUPLICATED, periods=10),
    Fault("SIGTERM", AGENT, signal.SIGTERM),
    Fault("SIGHUP", AGENT, signal.SIGHUP),
    Fault("exception", AGENT, raises=True, ends=True),
    Fault("readings lost", AGENT, line=READINGS_LOST, ends=True),
    Fault("kill -9, line stays open", WATCHDOG, signal.SIGKILL, half_open=True),
    Fault("kill -9, line closes", CONNECTION, signal.SIGKILL),
    Fault("hang (SIGSTOP)", WATCHDOG, signal.SIGSTOP, ends=True),
    Fault("commands lost", WATCHDOG, line=COMMANDS_LOST, ends=True),
    Fault("all packets lost", WATCHDOG, line=ALL_LOST, ends=True),
    Fault("unplugged, line closes", CONNECTION, line=UNPLUGGED, ends=True),
)
"""All faults: those in which the robot must go on, then by the side that must stop it."""


def passed(fault: Fault, trial: dict[str, Any]) -> bool:
    """Whether the right side stopped the robot in time, and an agent that could gave a reason."""
    in_time = trial["periods"] is None or trial["periods"] <= MOST_PERIODS
    explained = bool(trial["ended"]) or not fault.ends
    return bool(trial["stopped"] == fault.stops and in_time and explained)


RESTART = Fault("restart", AGENT, signal.SIGTERM)


class Lab:
    """The robot's process, and the one that forks agents.

    Args:
        period: control period of the robot on the wall's clock [s].
        memory: file of what the agents learn, which each goes on from.
        seed: of the moments of the faults, and of the postures.
    """

    def __init__(self, period: float, memory: Path, seed: int) -> None:
        token = {VARIABLE: new_token()}
        self._period, self._memory = period, memory
        self._rng, self._trials = np.random.default_rng(seed), 0
        self._robot = Host("robot_host", str(period), **token)
        self._agents = Host("agent_host", **token)
        self._port = self._expected(self._robot, "port")["port"]
        self._expected(self._agents, "ready", 300.0)
        self._known: tuple[int, int] | None = None
        self._newest: dict[str, Any] = {}

    def __enter__(self) -> Lab:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for host in (self._agents, self._robot):
            host.__exit__(kind, error, trace)

    def run(self, fault: Fault) -> dict[str, Any]:
        """Run one trial; again if this computer was too busy for it.

        A computer that is busy with other things may keep an agent from commanding for some control
        periods; then the watchdog does what it is for. Such an attempt does not count if the robot
        was stopped before the fault, or by another side than must stop it.

        Args:
            fault: that occurs.

        Returns:
            ``stopped``: who stopped the robot; ``periods`` until then, on the robot's own clock;
            ``ended``: the agent's last words; ``busy``: number of attempts that do not count. The
            next trial, or `restart`, adds ``kept``: whether what was learned is there.

        Raises:
            ExperimentError: no attempt counts, or something that must happen does not.
        """
        ended = ""
        for busy in range(MOST_ATTEMPTS):
            found = self._attempt(fault)
            ended = found["ended"]
            if not found.pop("early") and (passed(fault, found) or not found["late_step"]):
                self._newest = found | {"busy": busy}
                return self._newest
            self.restart()  # with little learned, the next steps are short
        raise ExperimentError(
            f"{MOST_ATTEMPTS} times in a row this computer kept the agent from commanding for some "
            "control periods: give a longer --period, or end other programs. The agent's last "
            f"words: {ended}"
        )

    def restart(self) -> None:
        """Start an agent once more, to see what it knows; then forget all."""
        began, _ = self._begin(RESTART)
        os.kill(began["pid"], signal.SIGTERM)
        self._expected(self._robot, "stopped")
        self._end(began["pid"])
        self._memory.unlink(missing_ok=True)
        self._known = None

    def _attempt(self, fault: Fault) -> dict[str, Any]:
        """One trial, and whether the robot was stopped before the fault (``early``)."""
        began, wait = self._begin(fault)
        time.sleep(wait)
        tick, learned, early = self._occur(fault, began["pid"])
        stopped = None if early else self._stopped(fault, began["pid"])
        exit_code, ended, later = self._end(began["pid"])
        self._remember(began["observations"], [*learned, *later])
        return {
            "fault": fault.name,
            "stopped": NO_ONE if stopped is None else stopped["by"],
            "periods": None if stopped is None else stopped["tick"] - tick,
            "ended": ended,
            "exit": exit_code,
            "early": early,
            "late_step": any(event["event"] == "late_step" for event in [*learned, *later]),
            "observations": began["observations"],
        }

    def _stopped(self, fault: Fault, process: int) -> Event | None:
        """Wait until the robot was stopped; None if it was not, and must not be."""
        if fault.stops != NO_ONE:
            stopped = self._expected(self._robot, "stopped")
            if fault.number == signal.SIGSTOP:
                os.kill(process, signal.SIGCONT)
            return stopped
        unwanted = self._robot.wait_for(["stopped"], GOES_ON * self._period)[0]
        if unwanted is None:
            os.kill(process, signal.SIGTERM)
            self._expected(self._robot, "stopped")
        return unwanted

    def _begin(self, fault: Fault) -> tuple[Event, float]:
        """Start an agent; its first event, and how long to wait until the fault [s]."""
        self._trials += 1
        wait = float(self._rng.uniform(4.0, 16.0))
        self._agents.order(
            port=self._port,
            memory=str(self._memory),
            seed=self._trials,
            half_open=fault.half_open,
            raises=int(wait) if fault.raises else None,
        )
        began = self._expected(self._agents, "began")
        self._newest.setdefault("kept", True)  # of the trial before
        self._newest["kept"] &= self._kept(began["observations"])
        return began, 0.0 if fault.raises else wait * self._period

    def _occur(self, fault: Fault, process: int) -> tuple[int, list[Event], bool]:
        """Let the fault occur.

        Returns:
            The control period of the robot, the agent's events until then, and whether the robot
            was stopped before.
        """
        if fault.raises:
            raised, before = self._agents.wait_for(["raised", "ended"], PATIENCE)
            if raised is None:
                raise ExperimentError("The agent did not raise its error.")
            early = raised["event"] == "ended"
            if early:
                self._expected(self._robot, "stopped")
            return int(raised.get("tick", 0)), before, early
        order = {"kind": fault.line, "periods": fault.periods} if fault.line else {}
        self._robot.order(**order)
        now, before = self._robot.wait_for(["fault"], PATIENCE)
        assert now is not None
        early = any(event["event"] == "stopped" for event in before)
        if fault.number is not None and not early:
            os.kill(process, fault.number)
        return int(now["tick"]), [], early

    def _end(self, process: int) -> tuple[int | None, str, list[Event]]:
        """Wait for the end of the agent's process; its exit code and last words."""
        found, events = self._agents.wait_for(["exit"], PATIENCE)
        if found is None:
            os.kill(process, signal.SIGKILL)
            self._expected(self._agents, "exit")
        self._agents.order()
        self._robot.order()  # the line is whole again
        self._expected(self._robot, "fault")
        errors = [event["error"] for event in events if event["event"] == "ended"]
        return None if found is None else found["code"], " ".join(errors), events

    def _remember(self, begin: int, events: list[Event]) -> None:
        """Note how much must be in the file: what was there, and what the agent has reported."""
        counts = {"saved": [begin], "learned": [begin]}
        for event in events:
            if event["event"] in counts:
                counts[event["event"]].append(event["observations"])
        self._known = max(counts["saved"]), max(counts["learned"])

    def _kept(self, observations: int) -> bool:
        """Whether a new agent knows what the one before had learned."""
        if self._known is None:
            return True
        least, most = self._known
        return least <= observations <= most + 1  # one may not have been reported any more

    def _expected(self, host: Host, event: str, timeout: float = PATIENCE) -> Event:
        found, _ = host.wait_for([event], timeout)
        if found is None:
            raise ExperimentError(f"A process has not reported {event!r} within {timeout:g} s.")
        return found
