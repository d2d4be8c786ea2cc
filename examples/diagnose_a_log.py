"""Diagnose a log: which mechanism does the model of a machine lack?

The machine, a pendulum with a servo, is simulated here: its joint has a spring that the model
lacks. Your own study is a folder with STUDY.yaml, a model and logs; see docs/reality_gap.md.
"""

from pathlib import Path

import mujoco
import numpy as np

from reality_gap import Options, diagnose, load_study, write_diagnosis

FOLDER = Path("out/diagnose_a_log")
STIFFNESS, NOISE = 0.8, 1e-3  # [N m/rad], [rad]
MODEL = """<mujoco><option integrator="implicitfast"/><worldbody><body>
<joint name="hinge" axis="0 1 0" damping="0.05"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1"/></body></worldbody>
<actuator><position name="motor" joint="hinge" kp="20" kv="1"/></actuator>
<sensor><jointpos name="angle" joint="hinge"/></sensor></mujoco>"""
STUDY = f"""{{name: pendulum, model: model.xml, time: {{column: t, unit: s}},
episodes: [{{commands: log.csv}}], actuators: {{motor: {{column: target, unit: rad}}}},
sensors: {{angle: {{column: angle, unit: rad, noise: {NOISE}}}}}}}"""


def record(path: Path) -> None:
    """Move the machine for 10 s, and write what it measures."""
    spec = mujoco.MjSpec.from_string(MODEL)
    spec.joint("hinge").stiffness = [STIFFNESS, 0.0, 0.0]
    model = spec.compile()
    data, rng, rows = mujoco.MjData(model), np.random.default_rng(0), []
    for t in np.arange(0.0, 10.0, 0.02):
        data.ctrl[0] = 0.8 * np.sin(2.0 * t) + 0.4 * np.sin(5.3 * t)
        rows.append((t, data.ctrl[0], data.qpos[0] + NOISE * rng.standard_normal()))
        mujoco.mj_step(model, data, round(0.02 / model.opt.timestep))
    np.savetxt(path, rows, delimiter=",", header="t,target,angle", comments="")


FOLDER.mkdir(parents=True, exist_ok=True)
(FOLDER / "model.xml").write_text(MODEL)
(FOLDER / "STUDY.yaml").write_text(STUDY)
record(FOLDER / "log.csv")
study = load_study(FOLDER / "STUDY.yaml")
diagnosis = diagnose(study, options=Options(suggest=False))
print(diagnosis.verdict.value, "-", diagnosis.sentence)
print(f"The machine has a spring of {STIFFNESS} N m/rad.")
write_diagnosis(diagnosis, study, FOLDER / "diagnosis")
print(f"Report: {FOLDER}/diagnosis/report.html")
