"""Machines: where each one's files lie, its study, and the parameters of its baselines.

A machine is an entry of `MACHINES`. Its files lie in a folder that the user gives; what the authors
of the data say is in docs/real_machines.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

from experiments.emps import log as emps
from experiments.harness.errors import ExperimentError
from experiments.real_machines import aero_hand, cable, psm, so101, tiago, two_link, tx40, xl330
from experiments.real_machines.baselines import PACE, PACE_EFFORT, PERSON, PERSON_EFFORT
from reality_gap import Study

PACE_NAME, PERSON_NAME = "PACE", "a person"


class Machine(NamedTuple):
    """A measured machine.

    Attributes:
        title: its name in tables and pictures.
        files: patterns of its files, relative to the user's folder; each must have a match.
        study: makes its study from that folder, the folder of the results and the longest log [s].
        baselines: names of the freed parameters by name of the baseline.
        published: values that the authors of the data published, as parameters of a baseline; see
            `experiments.real_machines.parameters`; None without such values.
        shared: whether joints and links share the parameters of the baselines, because the log says
            little of each.
    """

    title: str
    files: tuple[str, ...]
    study: Callable[[Path, Path, float], Study]
    baselines: Mapping[str, tuple[str, ...]]
    published: Mapping[str, float] | None
    shared: bool = False


def xl330_study(kp: float, data: Path, out: Path, seconds: float) -> Study:
    """Make the study of the XL330 pendulum at one gain.

    Raises:
        ExperimentError: there is no run at this gain.
    """
    logs = xl330.read_logs(data, kp)
    if not logs:
        raise ExperimentError(
            f"{data / xl330.FOLDER} has no run with kp {kp:g} in which the servo stays on."
        )
    if len({(log.mass, log.length, log.volts) for log in logs}) > 1:
        raise ExperimentError(
            f"{data / xl330.FOLDER} has runs with kp {kp:g} of several pendulums or voltages; "
            "leave those of one."
        )
    return xl330.write_study(logs, out, seconds)


def emps_study(data: Path, out: Path, seconds: float) -> Study:
    """Make the study of the EMPS drive."""
    log = emps.read_log(data / EMPS_FILE)
    first = log.time <= log.time[0] + seconds
    return emps.make_study(emps.Log(*(part[first] for part in vars(log).values())))


def per_joint(kinds: Mapping[str, tuple[float, ...]], joints: tuple[str, ...]) -> dict[str, float]:
    """Return parameters by key, from values of several joints by kind."""
    return {
        f"{kind} {joint}": value
        for kind, values in kinds.items()
        for joint, value in zip(joints, values, strict=True)
    }


EMPS_FILE = "emps/emps_train.csv"
SERVO = {PACE_NAME: PACE, PERSON_NAME: PERSON}
EFFORT = {PACE_NAME: PACE_EFFORT, PERSON_NAME: PERSON_EFFORT}
MACHINES = {
    "xl330_kp100": Machine(
        "XL330 pendulum, gain 100",
        (f"{xl330.FOLDER}/*.json",),
        partial(xl330_study, 100.0),
        SERVO,
        xl330.PUBLISHED,
    ),
    "xl330_kp400": Machine(
        "XL330 pendulum, gain 400",
        (f"{xl330.FOLDER}/*.json",),
        partial(xl330_study, 400.0),
        SERVO,
        xl330.PUBLISHED,
    ),
    "so101": Machine("SO-101 arm", so101.FILES, so101.make_study, SERVO, so101.PUBLISHED),
    "emps": Machine(
        "EMPS drive",
        (EMPS_FILE,),
        emps_study,
        EFFORT,
        {
            "damping": emps.PUBLISHED["viscous"],
            "friction": emps.PUBLISHED["coulomb"],
            "offset": emps.PUBLISHED["offset"],
        },
    ),
    "tiago": Machine("TIAGo arm", tiago.FILES, tiago.make_study, EFFORT, None),
    "tx40": Machine(
        "Staubli TX40",
        (tx40.POSITION, tx40.TORQUE, tx40.MODEL),
        tx40.make_study,
        EFFORT,
        per_joint(tx40.PUBLISHED, tx40.MEASURED),
    ),
    "two_link": Machine("two-link arm", (two_link.LOG,), two_link.make_study, EFFORT, None),
    "psm": Machine("dVRK PSM with 205 g", (psm.LOG,), psm.make_study, EFFORT, None),
    "davinci": Machine("da Vinci cable", (cable.FILE,), cable.make_study, SERVO, None),
    "aero_hand": Machine("Aero hand", aero_hand.FILES, aero_hand.make_study, SERVO, None, True),
}
"""All machines by key."""


def missing(name: str, data: Path) -> str | None:
    """Return one sentence if the files of a machine are missing, and else None."""
    machine = MACHINES[name]
    for pattern in machine.files:
        if not any(data.glob(pattern)):
            return f"{machine.title} is left out, for there is no {data / pattern}."
    return None
