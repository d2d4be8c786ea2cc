"""Friction between a motor's force sensor and an elastic cable, in machines with a simulated spool.

In the machines a motor pulls a load by a cable that is a spring; the model has neither the spring
nor the motor's friction, but a servo of the cable's length.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pytest

from reality_gap import Verdict, diagnose, load_study
from reality_gap.causes import CATALOGUE
from reality_gap.inference.screening import list_candidates
from reality_gap.inference.verdict import Options
from reality_gap.simulation.hypothesis import Part
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.types import Bools

LOAD = """<body name="load"><joint name="slide" type="slide" axis="1 0 0" damping="{damping}"
 stiffness="{spring}"/><geom size="0.01" mass="{mass}"/><site name="hook"/></body></worldbody>"""
PATH = """<site site="eye"/><site site="hook"/></spatial></tendon>"""
MACHINE = f"""<mujoco><option timestep="0.0001" integrator="implicitfast"/><worldbody>
<body name="motor" pos="-1 0 0"><joint name="spool" type="slide" axis="1 0 0" armature="{{spool}}"
 frictionloss="{{friction}}" solreffriction="0.0005 1" solimpfriction=".9999 .9999 .001 .5 2"/>
<geom size="0.01" mass="0.001"/><site name="eye"/></body>{LOAD}
<tendon><spatial name="cable" stiffness="{{cable}}" springlength="1">{PATH}
<actuator><position name="servo" joint="spool" kp="{{kp}}" kv="{{kv}}"/></actuator></mujoco>"""
MODEL = f"""<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<site name="eye" pos="-1 0 0"/>{LOAD}<tendon><spatial name="cable">{PATH}
<actuator><general name="servo" tendon="cable" gainprm="{{gain}}" biastype="affine"
 biasprm="0 -{{kp}} -{{kv}}"/></actuator>
<sensor><actuatorfrc name="force" actuator="servo"/>
<jointpos name="position" joint="slide"/></sensor>
</mujoco>"""
STUDY = """name: cable
model: model.xml
episodes: [{{commands: log.csv}}]
time: {{column: time, unit: s}}
actuators: {{servo: {{column: command, unit: {unit}}}}}
sensors:
  force: {{column: force, unit: N, noise: {force}}}
  position: {{column: position, unit: m, noise: {position}}}
initial: {{settle: 1.0}}
"""
KINDS = ("tendon_elasticity", "motor_side_friction", "coulomb_friction", "viscous_friction")


class Size(NamedTuple):
    """Sizes of a machine: largest pull [N], travel [m], friction over the pull."""

    pull: float
    travel: float
    friction: float

    @property
    def sizes(self) -> dict[str, float]:
        spring = self.pull / self.travel
        return {
            "spring": spring,
            "damping": 0.15 * spring,
            "mass": 1e-4 * spring,
            "spool": 2e-5 * spring,
            "kp": 50.0 * spring,
            "kv": 0.01 * spring,
            "cable": 20.0 * spring,
            "friction": self.friction * self.pull,
        }


DRIVE, FINGER, WINCH = Size(80.0, 0.02, 0.12), Size(4.0, 0.008, 0.2), Size(2000.0, 0.3, 0.08)


def logged(folder: Path, size: Size, friction: float = 1.0, unit: float = 1.0) -> Study:
    """Study of a machine that pulls to and fro for 6 s, with five commands for each reading.

    One of the commands is a length of ``unit`` [m].
    """
    sizes = size.sizes
    machine = MACHINE.format(**sizes | {"friction": friction * sizes["friction"]})
    model = mujoco.MjModel.from_xml_string(machine)
    data, rng = mujoco.MjData(model), np.random.default_rng(4)
    noise = {"force": 5e-3 * size.pull, "position": 1e-3 * size.travel}

    def command(t: float) -> float:
        pulled = 0.5 + 0.35 * np.sin(2.1 * t - 1.5) + 0.12 * np.sin(5.3 * t)
        return -size.travel * float(pulled)

    data.ctrl[0] = command(0.0)
    mujoco.mj_step(model, data, 20_000)
    rows = []
    for k in range(3000):
        row = f"{0.002 * k:.9g},{(1.0 + command(0.002 * k)) / unit:.9g}"
        if k % 5 == 0:
            force = data.actuator_force[0] + noise["force"] * rng.standard_normal()
            position = data.joint("slide").qpos[0] + noise["position"] * rng.standard_normal()
            rows.append(f"{row},{force:.9g},{position:.9g}")
        else:
            rows.append(f"{row},,")
        for i in range(20):  # the drive goes on smoothly between two commands
            data.ctrl[0] = command(0.002 * k + 0.0001 * i)
            mujoco.mj_step(model, data)
    (folder / "log.csv").write_text("\n".join(["time,command,force,position", *rows]))
    (folder / "model.xml").write_text(MODEL.format(gain=unit * sizes["kp"], **sizes))
    (folder / "STUDY.yaml").write_text(STUDY.format(unit="m" if unit == 1.0 else "1", **noise))
    return load_study(folder / "STUDY.yaml")


@pytest.mark.parametrize(
    ("size", "unit"), [(DRIVE, 1.0), (FINGER, 1.0), (WINCH, 1.0), (DRIVE, 0.02)]
)
def test_the_force_is_that_of_a_simulated_spool(tmp_path: Path, size: Size, unit: float) -> None:
    with Replayer(logged(tmp_path, size, unit=unit)) as replayer:
        listed = list_candidates(replayer.system, [CATALOGUE[id] for id in KINDS[:2]])
        elastic, rubbing = (
            next(one for one in listed if one.cause.id == id and len(one.location.elements) == 1)
            for id in KINDS[:2]
        )
        stretched = (elastic, {"compliance": 1.0 / size.sizes["cable"]})
        friction = rubbing.null_values() | {"friction": size.sizes["friction"]}
        forces, positions = (replayer.measured.channel == k for k in (0, 1))

        def left(*parts: Part, of: Bools = forces) -> float:
            return float(np.sqrt(np.mean(replayer.residual(parts)[of] ** 2)))

        assert left(stretched) > 10.0
        assert left(stretched, (rubbing, friction)) < 0.4 * left(stretched)
        assert left(stretched, (rubbing, friction), of=positions) < 1.3


@pytest.mark.parametrize("size", [pytest.param(DRIVE, marks=pytest.mark.slow), FINGER])
def test_it_is_named_beside_the_elasticity_of_the_cable(tmp_path: Path, size: Size) -> None:
    causes = [CATALOGUE[id] for id in KINDS]
    found = diagnose(logged(tmp_path, size), causes=causes, options=Options(suggest=False))

    assert found.verdict.has_names
    named = {one.candidate.cause.id: one for one in found.causes}
    assert set(named) == {"tendon_elasticity", "motor_side_friction"}
    friction = named["motor_side_friction"].parameters["friction"]
    assert friction.value == pytest.approx(size.sizes["friction"], rel=0.1)
    compliance = named["tendon_elasticity"].parameters["compliance"]
    assert compliance.value == pytest.approx(1.0 / size.sizes["cable"], rel=0.03)


def test_a_motor_that_does_not_rub_gets_no_such_name(tmp_path: Path) -> None:
    causes = [CATALOGUE[id] for id in KINDS]
    study = logged(tmp_path, DRIVE, friction=0.0)
    found = diagnose(study, causes=causes, options=Options(suggest=False))

    assert found.verdict is Verdict.NAMED
    assert [one.candidate.cause.id for one in found.causes] == ["tendon_elasticity"]
