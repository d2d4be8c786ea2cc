"""Delay: commands act late, or sensors are read late, by a constant time.

MuJoCo delays commands by at least one time step. A shorter delay is an effect on the commands,
which interpolates linearly and equals MuJoCo's delay at one step, so that the replay is a
continuous function of the delay. Sensors of one kind share a bus and therefore a delay, as do the
position and the orientation of a marker. A delay of sensors is negative where their time stamps are
too early, and one of all commands where theirs are too late. The delay of sensors shifts the
record, because other causes edit the record; MuJoCo's own sensor delay would act before them. Where
efforts are compared by inverse dynamics, all of them together are late or early against the
positions.
"""

from __future__ import annotations

import math
from functools import partial

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.causes.support import clocks, efforts, elements
from reality_gap.study.system import System, column, commanded
from reality_gap.types import Floats

FRAMES = tuple(
    int(getattr(mujoco.mjtSensor, f"mjSENS_FRAME{part}"))
    for part in ("POS", "QUAT", "XAXIS", "YAXIS", "ZAXIS")
)
SECANTS = (0.03, 0.1)
"""Delays at which the cause is screened in addition to a small one [s]; the slope at zero points
the wrong way where a delay also changes how a machine sticks."""
NEARBY = tuple(sign * size for size in (0.0005, 0.001, 0.002, 0.003, 0.005) for sign in (1.0, -1.0))
"""Differences from a fitted delay that are tried [s]: a machine that sticks stops elsewhere with
each step of delay more, and a reading is taken before or after the step of a command."""
ALONE = -3.0
"""Log odds of a delay of one actuator [nats]: delays of a whole bus are usual. Sensors of one kind
are on one bus."""
EFFORTS = "efforts after positions"
"""Note of the location of all efforts that are compared by inverse dynamics. Positions may also be
read after them, so that this delay may be negative."""
OF_PERIOD = 0.03
"""Tolerance of a delay of efforts over the time between two of their readings: what happens between
them, such as a reversal of friction, is not seen and looks like a small delay."""
EARLIEST = 0.5
"""Largest time by which the sensors of a kind, or all commands, are early [s]: where time stamps of
commands are late, or logs were aligned wrongly, readings show what a command does before it."""
LINEAR = 1
"""MuJoCo's value of ``interp`` for linear interpolation."""


def _locations(system: System) -> tuple[Location, ...]:
    if system.study.inverse:
        return (Location("joint", efforts.joints(system), EFFORTS),)
    kinds = dict.fromkeys(_bus(system, name) for name in system.sensed)
    groups = [tuple(name for name in system.sensed if _bus(system, name) == kind) for kind in kinds]
    actuators = elements.each_actuator(system) + elements.all_actuators(system)
    return actuators + tuple(Location("sensor", group) for group in groups)


def _bus(system: System, sensor: str) -> int:
    """Return a number that sensors on one bus share: their kind; all kinds of frames are one."""
    kind = int(system.model.sensor(sensor).type[0])
    return FRAMES[0] if kind in FRAMES else kind


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.note == EFFORTS:
        hints = SearchHints(secants=(*(-s for s in SECANTS), *SECANTS))
        tolerance = max(0.0001, OF_PERIOD * system.study.period)
        return (Parameter("delay", "s", 0.004, tolerance, -0.5, 0.5, hints=hints),)
    early, secants = 0.0, elements.secants(system, location, SECANTS)
    if location.kind == "sensor" or len(location.elements) == len(commanded(system.model)):
        early, secants = -EARLIEST, (*(-s for s in SECANTS), *SECANTS)
    hints = SearchHints(secants=secants, nearby=NEARBY)
    least = clocks.least_delay(system)
    return (Parameter("delay", "s", 0.004, 0.00005, early, 0.5, hints=hints, least=least),)


def _prior(location: Location) -> float:
    return ALONE if len(location.elements) == 1 and location.kind == "actuator" else 0.0


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    step = spec.option.timestep
    if location.kind != "actuator" or values["delay"] < step:
        return
    for name in location.elements:
        actuator = spec.actuator(name)
        actuator.delay += values["delay"]
        actuator.nsample = math.ceil(actuator.delay / step) + 1
        actuator.interp = LINEAR


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    delay = values["delay"]
    if location.note == EFFORTS:
        effects.efforts.append(partial(_late_efforts, location.elements, delay))
        return
    if location.kind == "sensor":
        effects.readings.append(partial(_read_late, location.elements, delay))
        return

    def command(model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        columns = [column(model, name) for name in location.elements]
        if delay < 0.0:
            return clocks.delayed(time, command, columns, delay)
        command = command.copy()
        change = np.diff(command[:, columns], axis=0)
        command[1:, columns] -= change * delay / model.opt.timestep
        return command

    if delay < system.model.opt.timestep:
        effects.commands.append(command)


def _read_late(sensors: tuple[str, ...], delay: float, record: Record) -> None:
    clocks.read_at(record, sensors, record.time - delay, record.time)


def _late_efforts(
    joints: tuple[str, ...], delay: float, model: mujoco.MjModel, time: Floats, effort: Floats
) -> None:
    dofs = [int(model.joint(name).dofadr[0]) for name in joints]
    then = np.clip(time - delay, time[0], time[-1])
    # The samples are too far apart for linear interpolation.
    effort[:, dofs] = CubicSpline(time, effort[:, dofs])(then)


CAUSE = Cause(
    id="delay",
    title="delay",
    explanation="Commands act late, or sensors are read late, by a constant time.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    prior=_prior,
)
