"""Public models: a model goes from its file to a judged diagnosis; unusable ones are named."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from experiments.harness.errors import ExperimentError
from experiments.public_models import run, trial
from experiments.public_models.catalogue import MODELS, PublicModel, find
from experiments.public_models.machine import Machine, make_machine, with_payload
from experiments.public_models.motion import Motion
from experiments.public_models.run import Args
from experiments.public_models.study import Noise, noise_of, payload_mass, write_study
from experiments.public_models.tables import false_names, is_right, metrics, sure_and_wrong
from reality_gap import load_study
from reality_gap.simulation.replayer import Replayer

MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.004"/>
  <default><joint damping="1"/></default>
  <worldbody>
    <geom type="plane" size="2 2 1"/>
    <body name="torso" pos="0 0 0.3">
      <freejoint/>
      <geom type="sphere" size="0.1" mass="3"/>
      <body name="thigh">
        <joint name="hip" axis="0 1 0" range="-2 2" limited="true"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1"/>
        <body name="shin" pos="0 0 -0.3">
          <joint axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="0.5"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position joint="hip" kp="60" ctrlrange="-1 1" ctrllimited="true"/>
  </actuator>
  <keyframe><key qpos="0 0 0 1 0 0 0 0 0"/></keyframe>
</mujoco>
"""
ENTRY = PublicModel("robots/leg.xml", "legs")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "package" / "robots"
    path.mkdir(parents=True)
    (path / "leg.xml").write_text(MODEL)
    return tmp_path / "package"


def machine(folder: Path, entry: PublicModel = ENTRY) -> Machine:
    path = find(entry, (folder,))
    assert path is not None
    return make_machine(path, entry)


def test_a_legged_model_hangs_on_a_stand_with_named_elements_and_a_sensor(folder: Path) -> None:
    found = machine(folder)
    model = found.spec.copy().compile()
    assert model.nq == 2
    assert found.end == "shin"
    assert [(s.name, s.unit, s.range) for s in found.sensors] == [("at_hip", "rad", 4.0)]
    assert any("welded" in note for note in found.notes)
    assert all(model.joint(i).name for i in range(model.njnt))
    heavier = with_payload(found, 0.2).compile()
    assert heavier.body_mass.sum() == pytest.approx(model.body_mass.sum() + 0.2)
    assert heavier.body("hidden_ball").pos == pytest.approx([0.0, 0.0, -0.15])  # centre of the shin


def test_objects_are_removed_and_a_payload_hangs_at_a_site(folder: Path) -> None:
    text = MODEL.replace("<freejoint/>", '<freejoint/><site name="camera" pos="1 0 0"/>')
    text = text.replace(
        'size="0.03" mass="0.5"/>', 'size="0.03" mass="0.5"/><site pos="0 0 -0.3"/>'
    )
    ball = '<body name="ball"><joint name="roll"/><geom size="0.1"/></body></worldbody>'
    text = text.replace("</worldbody>", ball)
    text = text.replace('<keyframe><key qpos="0 0 0 1 0 0 0 0 0"/></keyframe>', "")
    (folder / "robots" / "leg.xml").write_text(text)
    found = machine(folder, ENTRY._replace(without=("ball",)))
    assert found.spec.copy().compile().nq == 2
    assert "ball was removed." in found.notes
    heavier = with_payload(found, 0.2).compile()
    assert heavier.body("hidden_ball").pos == pytest.approx([0.0, 0.0, -0.3])
    tendon = '<tendon><spatial><site site="camera"/><site site="end"/></spatial></tendon></mujoco>'
    text = text.replace('<site pos="0 0 -0.3"/>', '<site name="end" pos="0 0 -0.3"/>')
    (folder / "robots" / "leg.xml").write_text(text.replace("</mujoco>", tendon))
    heavier = with_payload(machine(folder, ENTRY._replace(without=("ball",))), 0.2).compile()
    assert heavier.body("hidden_ball").pos == pytest.approx([0.0, 0.0, -0.15])


def test_the_study_is_that_of_the_model_and_a_payload_has_the_wanted_effect(
    folder: Path, tmp_path: Path
) -> None:
    found = machine(folder)
    motion = Motion(found, 3, 3.0)
    nominal = motion.log(0.0)
    noise = noise_of(found, nominal, quantised=True)
    assert noise.stated()[0] == pytest.approx(4e-3, rel=0.01)
    write_study(tmp_path / "study", found, nominal, noise, 0)
    study = load_study(tmp_path / "study" / "STUDY.yaml")
    with Replayer(study) as replayer:
        null = replayer.residual([])
    assert np.sqrt(np.mean(null**2)) == pytest.approx(1.0, abs=0.1)
    mass, effect = payload_mass(motion, noise)
    assert 5.0 <= effect <= 20.0
    change = (motion.log(mass).readings - nominal.readings) / noise.stated()
    assert np.sqrt(np.mean(change**2)) == pytest.approx(effect)


def test_a_payload_is_heavier_than_what_a_model_may_be_wrong_by(folder: Path) -> None:
    """On a machine whose readings are very accurate, its effect is larger than usual."""
    found = machine(folder)
    motion = Motion(found, 3, 3.0)
    noise = noise_of(found, motion.log(0.0), quantised=False)
    accurate = Noise(noise.size / 1000.0, noise.torque, noise.steps)
    mass, effect = payload_mass(motion, accurate)
    assert mass == pytest.approx(0.05 * 0.5)
    assert 20.0 < effect < 1000.0
    with pytest.raises(ExperimentError, match=r"no payload of shin of .* has an effect of 5 to 20"):
        payload_mass(motion, Noise(noise.size / 1e6, noise.torque, noise.steps))


def test_a_merged_file_has_the_units_of_its_package(folder: Path) -> None:
    path = folder / "robots" / "leg.xml"
    path.write_text(MODEL.replace('<compiler angle="radian"/>', "").replace(' limited="true"', ""))
    found = machine(folder, ENTRY._replace(merged=True)).spec.copy().compile()
    assert found.joint("hip").range == pytest.approx([-2.0, 2.0])
    assert found.jnt_limited[found.joint("hip").id]


def test_motions_are_made_smaller_until_no_joint_reaches_its_stop(folder: Path) -> None:
    path = folder / "robots" / "leg.xml"
    text = MODEL.replace('range="-2 2"', 'range="-0.1 0.1"')
    path.write_text(text.replace('mass="3"/>', 'mass="3" contype="0" conaffinity="0"/>'))
    motion = Motion(machine(folder), 3, 4.0)
    assert motion.share < 0.7
    assert motion.log(0.0).touching <= 0.02 < motion.log(0.0, 0.7).touching


def test_a_machine_that_follows_has_torques_in_its_log(folder: Path, tmp_path: Path) -> None:
    text = MODEL.replace('<position joint="hip" kp="60" ctrlrange="-1 1"', '<motor joint="hip"')
    text = text.replace('ctrllimited="true"', 'ctrlrange="-40 40" ctrllimited="true"')
    text = text.replace('<joint axis="0 1 0"/>', "").replace("1 0 0 0 0 0", "1 0 0 0 0")
    (folder / "robots" / "leg.xml").write_text(text)
    found = machine(folder, ENTRY._replace(torques=True))
    motion = Motion(found, 3, 4.0)
    log = motion.log(0.0)
    assert log.command.shape == log.readings.shape
    assert np.ptp(log.readings) > 0.2
    moved = Motion(machine(folder, ENTRY._replace(torques=True, home={"hip": 0.3})), 3, 4.0)
    assert moved.log(0.0, motion.share).readings == pytest.approx(log.readings + 0.3, abs=0.02)
    write_study(tmp_path / "study", found, log, noise_of(found, log, quantised=False), 0)
    study = load_study(tmp_path / "study" / "STUDY.yaml")
    assert study.inverse
    with Replayer(study) as replayer:
        assert np.sqrt(np.mean(replayer.residual([]) ** 2)) < 1.6


def answer(**more: Any) -> dict[str, Any]:
    names: dict[str, Any] = {"kind": "payload", "end_link": ["shin", "foot"], "causes": []}
    return {"model": "leg", "unusable": "", "verdict": "named", **names, **more}


def cause(id: str, element: str, confidence: float = 0.97, **more: Any) -> dict[str, Any]:
    found = {"cause": id, "elements": [element], "confidence": confidence}
    return {"equivalent": [], "elsewhere": [], **found, **more}


def test_answers_are_right_if_the_payload_and_nothing_else_is_named() -> None:
    assert is_right(answer(causes=[cause("payload", "shin")]))
    assert is_right(answer(causes=[cause("link_mass", "foot")]))
    assert is_right(answer(causes=[cause("armature", "knee", equivalent=["payload"])]))
    elsewhere = [{"elements": ["foot"]}]
    assert is_right(answer(causes=[cause("payload", "thigh", elsewhere=elsewhere)]))
    assert not is_right(answer(verdict="unexplained"))
    assert not is_right(answer(causes=[cause("link_mass", "thigh")]))
    both = answer(causes=[cause("payload", "shin"), cause("delay", "hip", 0.5)])
    assert not is_right(both)
    assert not sure_and_wrong(both)
    assert len(false_names(both)) == 1
    for confidence, sure in ((0.9, True), (0.89, False)):
        false = answer(kind="null", causes=[cause("payload", "shin", confidence)])
        assert sure_and_wrong(false) == sure
    assert is_right(answer(kind="null", verdict="nothing_wrong"))
    found = metrics([answer(causes=[cause("payload", "shin")]), answer(verdict="unexplained")])
    assert found["right"]["value"] == 0.5
    assert not found["models"]["reached"]
    assert found["sure_and_wrong"]["reached"]


def test_a_process_that_takes_too_long_is_ended(tmp_path: Path) -> None:
    begin = time.monotonic()
    with (tmp_path / "out").open("w") as stream:
        code, _ = trial.run_limited(
            [sys.executable, "-c", "import time; time.sleep(60)"], stream, 0.5
        )
    assert code is None
    assert time.monotonic() - begin < 20.0


@pytest.mark.parametrize(
    ("program", "verdict", "printed"),
    [
        ("import sys; print('the log is empty', file=sys.stderr); sys.exit(2)", "refused", "empty"),
        ("raise KeyError('name')", "error", "KeyError"),
    ],
)
def test_refusals_and_raw_errors_are_distinguished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str, verdict: str, printed: str
) -> None:
    limited = trial.run_limited
    command = [sys.executable, "-c", program]
    monkeypatch.setattr(trial, "run_limited", lambda _, stream, limit: limited(command, stream, 30))
    found = trial.diagnosis(tmp_path / "STUDY.yaml", tmp_path / "out", 30.0)
    assert found["verdict"] == verdict
    assert printed in found["sentence"]


def test_models_go_through_the_runner_and_others_are_named(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(MODELS, "leg", ENTRY)
    named = {"verdict": "nothing_wrong", "sentence": "", "causes": [], "rejected": []}
    more = {"rms_before": 1.0, "rms_after": 1.0, "core_seconds": 1.0, "memory": 300, "measures": {}}
    monkeypatch.setattr(trial, "diagnosis", lambda study, out, limit: {**named, **more})
    args = Args((folder,), tmp_path / "out", only=("leg", "ur5e"), seconds=2.0)
    summary = run.main(args)
    saved = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert saved["metrics"] == summary["metrics"]
    assert saved["metrics"]["right"]["value"] == 0.5
    assert "ur5e/robot.xml" in saved["skipped"]["ur5e"]
    assert (tmp_path / "out" / "leg_payload" / "study" / "STUDY.yaml").is_file()
    with pytest.raises(ExperimentError, match="no model 'dog'; there are: pendulum"):
        run.main(Args((folder,), tmp_path, only=("dog",)))
    with pytest.raises(ExperimentError, match="no folder"):
        run.main(Args((tmp_path / "none",), tmp_path))
    with pytest.raises(ExperimentError, match="No model can be used"):
        run.main(Args((folder,), tmp_path, only=("ur5e",)))


def test_models_that_cannot_be_used_get_one_sentence(folder: Path) -> None:
    path = folder / "robots" / "leg.xml"
    path.write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(ExperimentError, match="no actuator"):
        machine(folder)
    path.write_text("<mujoco><oops/></mujoco>")
    with pytest.raises(ExperimentError, match="cannot be loaded"):
        machine(folder)
    assert mujoco.MjSpec().compile().nq == 0
