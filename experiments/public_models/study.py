"""Study: the model, the log and STUDY.yaml of a public model, as somebody would write them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.public_models.machine import Machine
from experiments.public_models.motion import SETTLE, Log, Motion, command_ranges
from jmm_agent.types import Floats
from reality_gap.report.model_assets import write_model

NOISE = 1e-3
"""Standard deviation of a sensor's noise over its range."""
FINE_NOISE = 2e-5
"""The same of positions beside torques, which are differentiated."""
BITS = 12
"""Resolution of the quantised sensors over their range."""
EFFECT = (5.0, 20.0)
"""Range of the effect of a payload: RMS of the channel that it changes most [noise]."""
UNSTABLE = 1000.0
"""Effect of the least payload from which on a simulation is unstable [noise]."""
HEAVY = 2.0
"""Largest mass of a payload over that of the machine."""
TRIES = 12
"""Largest number of simulations that size a payload."""
LEAST_MASS = 0.05
"""Least mass of a payload, which is tried first, over that of the link that carries it. Models may
be wrong by 0.8 % of it without a fault."""


@dataclass(frozen=True)
class Noise:
    """Noise of the sensors.

    Attributes:
        size: standard deviation of each sensor, shape (n,) [unit].
        torque: the same of each torque, shape (m,); empty where commands are logged [N m or N].
        steps: step of quantisation of each sensor; 0 without, shape (n,) [unit].
    """

    size: Floats
    torque: Floats
    steps: Floats

    def stated(self) -> Floats:
        """Standard deviation of each sensor with its quantisation, shape (n,) [unit]."""
        found: Floats = np.hypot(self.size, self.steps / np.sqrt(12.0))
        return found


def noise_of(machine: Machine, log: Log, quantised: bool) -> Noise:
    """Noise of a machine's sensors, which follows from their ranges."""
    ranges = np.array([sensor.range for sensor in machine.sensors])
    ranges = np.where(np.isnan(ranges), np.ptp(log.readings, axis=0), ranges)
    torque = np.zeros(0)
    if machine.torques:
        low, high = command_ranges(machine.spec.copy().compile())
        torque = NOISE * np.maximum(high - low, 1e-9)[: log.command.shape[1]]
    if machine.torques:
        return Noise(FINE_NOISE * ranges, torque, np.zeros(len(ranges)))
    steps = ranges / 2**BITS if quantised else np.zeros(len(ranges))
    return Noise(NOISE * ranges, torque, steps)


def payload_mass(motion: Motion, noise: Noise) -> tuple[float, float]:
    """Return the mass of a payload [kg] whose effect is within `EFFECT`, and that effect.

    On a machine that is very sensitive the least mass may have a larger effect.

    Raises:
        ExperimentError: no mass has such an effect.
    """
    nominal, middle = motion.log(0.0), float(np.sqrt(EFFECT[0] * EFFECT[1]))
    machine = motion.machine
    model = machine.spec.copy().compile()
    link = model.body_weldid == model.body_weldid[model.body(machine.end).id]
    least = mass = LEAST_MASS * float(model.body_mass[link].sum())
    most = HEAVY * float(model.body_mass.sum())
    effect = 0.0
    for _ in range(TRIES):
        log = motion.log(mass)
        changes = [(log.readings - nominal.readings) / noise.stated()]
        if machine.torques:
            changes = [(log.command - nominal.command) / noise.torque]
        effect = float(np.sqrt(np.mean(np.hstack(changes) ** 2, axis=0)).max())
        if mass == least and effect > UNSTABLE:
            break
        if EFFECT[0] <= effect <= EFFECT[1] or (mass == least and effect > EFFECT[1]):
            return mass, effect
        if mass >= most and effect < EFFECT[0]:
            break
        mass *= float(np.clip(middle / max(effect, 1e-9), 0.1, 10.0)) ** 0.8
        mass = float(np.clip(mass, least, most))
    raise ExperimentError(
        f"no payload of {machine.end} of {machine.path} has an effect of {EFFECT[0]:g} to "
        f"{EFFECT[1]:g} noises; the last one had {effect:.3g}"
    )


def write_study(folder: Path, machine: Machine, log: Log, noise: Noise, seed: int) -> None:
    """Write model.xml with its assets, log.csv and STUDY.yaml."""
    folder.mkdir(parents=True, exist_ok=True)
    write_model(machine.spec.copy().to_xml(), machine.path, folder / "model.xml")
    rng = np.random.default_rng([seed, 9])
    readings = log.readings + noise.size * rng.standard_normal(log.readings.shape)
    coarse = np.where(noise.steps > 0.0, noise.steps, 1.0)
    readings = np.where(noise.steps > 0.0, np.round(readings / coarse) * coarse, readings)
    command = log.command
    if machine.torques:
        command = command + noise.torque * rng.standard_normal(command.shape)
    names = ["time", *_columns(machine), *(sensor.name for sensor in machine.sensors)]
    rows = np.column_stack([log.time, command, readings])
    text = "\n".join([",".join(names), *(",".join(f"{x:.9g}" for x in row) for row in rows)])
    (folder / "log.csv").write_text(text + "\n", encoding="utf-8")
    content = json.dumps(_content(machine, noise), indent=1)  # JSON is YAML
    (folder / "STUDY.yaml").write_text(content + "\n", encoding="utf-8")


def _columns(machine: Machine) -> list[str]:
    if machine.torques:
        return [f"torque_{sensor.element}" for sensor in machine.sensors]
    return [f"command_{actuator.name}" for actuator in machine.spec.actuators]


def _content(machine: Machine, noise: Noise) -> dict[str, Any]:
    sensors = {
        sensor.name: {"column": sensor.name, "unit": sensor.unit, "noise": float(size)}
        for sensor, size in zip(machine.sensors, noise.stated(), strict=True)
    }
    found: dict[str, Any] = {
        "name": machine.path.stem,
        "model": "model.xml",
        "episodes": [{"commands": "log.csv"}],
        "time": {"column": "time", "unit": "s"},
        "sensors": sensors,
    }
    columns = _columns(machine)
    if machine.torques:
        found["efforts"] = {
            sensor.element: {
                "column": column,
                "unit": "N m" if sensor.unit == "rad" else "N",
                "noise": float(size),
            }
            for sensor, column, size in zip(machine.sensors, columns, noise.torque, strict=True)
        }
    else:
        model = machine.spec.copy().compile()
        found["actuators"] = {
            actuator.name: {"column": column, "unit": _unit(model, i)}
            for i, (actuator, column) in enumerate(
                zip(machine.spec.actuators, columns, strict=True)
            )
        }
        found["initial"] = {"joints": machine.home, "settle": SETTLE}
    return found


def _unit(model: mujoco.MjModel, actuator: int) -> str:
    """Unit of a command: that of a position for a position servo, and otherwise 1."""
    affine = int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
    gain, feedback = model.actuator_gainprm[actuator, 0], model.actuator_biasprm[actuator, 1]
    if not affine or feedback == 0.0 or gain != -feedback:
        return "1"
    target = int(model.actuator_trnid[actuator, 0])
    hinge = int(model.jnt_type[target]) == int(mujoco.mjtJoint.mjJNT_HINGE)
    on_joint = int(model.actuator_trntype[actuator]) == int(mujoco.mjtTrn.mjTRN_JOINT)
    return "rad" if on_joint and hinge else "m"
