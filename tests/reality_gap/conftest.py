"""Fixtures: a small machine with two tendons, a good study of it on disk, and made-up diagnoses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

from reality_gap.causes import find_cause
from reality_gap.diagnosis import (
    Criterion,
    Dependence,
    Diagnosis,
    Doubt,
    Estimate,
    Experiment,
    FittedCandidate,
    Gain,
    NamedCause,
    Rejected,
    Share,
    Trace,
    Verdict,
)
from reality_gap.inference import evidence
from reality_gap.inference.evidence import PRIOR
from reality_gap.io.loader import load_study
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import replay
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured, measured
from reality_gap.study.splits import split
from reality_gap.study.system import System, compile_system

MODEL = """
<mujoco model="lever">
  <option timestep="0.004" integrator="implicitfast"/>
  <worldbody>
    <camera name="eye" pos="0.2 -1 0"/>
    <site name="flexor_0" pos="0.05 0 0.1"/>
    <site name="extensor_0" pos="-0.05 0 0.1"/>
    <body name="lever" pos="0 0 0">
      <joint name="elbow" axis="0 -1 0" range="-60 60" damping="1"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/>
      <site name="flexor_1" pos="0.03 0 -0.1"/>
      <site name="extensor_1" pos="-0.03 0 -0.1"/>
      <site name="marker" pos="0 0 -0.3"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="flexor"><site site="flexor_0"/><site site="flexor_1"/></spatial>
    <spatial name="extensor"><site site="extensor_0"/><site site="extensor_1"/></spatial>
  </tendon>
  <actuator>
    <general name="flexor" tendon="flexor" gainprm="5000" biastype="affine"
             biasprm="-10 -5000 0" forcelimited="true" forcerange="-400 -10"/>
    <general name="extensor" tendon="extensor" gainprm="5000" biastype="affine"
             biasprm="-10 -5000 0" forcelimited="true" forcerange="-400 -10"/>
  </actuator>
  <sensor>
    <tendonpos name="length_flexor" tendon="flexor"/>
    <tendonpos name="length_extensor" tendon="extensor"/>
    <actuatorfrc name="tension_flexor" actuator="flexor"/>
    <actuatorfrc name="tension_extensor" actuator="extensor"/>
    <jointpos name="angle_elbow" joint="elbow"/>
    <framepos name="marker_position" objtype="site" objname="marker"
              reftype="camera" refname="eye"/>
    <framequat name="marker_turn" objtype="site" objname="marker" reftype="camera" refname="eye"/>
  </sensor>
</mujoco>
"""


@dataclass
class StudyFolder:
    """A study on disk, for tests that change it.

    Attributes:
        path: path of STUDY.yaml.
        content: content of STUDY.yaml; call `write` after changes.
        logs: columns of each log, by file name; call `write` after changes.
    """

    path: Path
    content: dict
    logs: dict[str, dict[str, list]]

    def write(self) -> Path:
        """Write STUDY.yaml and the logs, and return the path of STUDY.yaml."""
        for name, columns in self.logs.items():
            rows = [columns, *zip(*columns.values(), strict=True)]
            text = "".join(",".join(map(str, row)) + "\n" for row in rows)
            (self.path.parent / name).write_text(text, encoding="utf-8")
        self.path.write_text(yaml.safe_dump(self.content, sort_keys=False), encoding="utf-8")
        return self.path


def _log(seconds: float, phase: float) -> tuple[dict[str, list], dict[str, list]]:
    """Simulate the machine with noise: its log at 50 Hz and that of its camera at 10 Hz."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    random = np.random.default_rng(round(10 * phase))
    robot: dict[str, list] = {}
    camera: dict[str, list] = {}
    for k in range(round(50 * seconds)):
        angle = 0.5 * np.sin(1.5 * k / 50 + phase)
        data.ctrl[:] = 0.2 - 0.03 * angle, 0.2 + 0.03 * angle
        if k == 0:
            mujoco.mj_step(model, data, 250)
        mujoco.mj_forward(model, data)
        _add(robot, {"time": 0.02 * k})
        for i, tendon in enumerate(("flexor", "extensor")):
            length = data.sensor(f"length_{tendon}").data[0] + random.normal(0, 1e-4)
            tension = random.normal(0, 0.5) - data.sensor(f"tension_{tendon}").data[0]
            _add(robot, {f"target_{tendon}": data.ctrl[i]})
            _add(robot, {f"length_{tendon}": length, f"tension_{tendon}": tension})
        _add(robot, {"angle_elbow": data.qpos[0] + random.normal(0, 1e-4)})
        if k % 5 == 0:
            x, y, z = data.sensor("marker_position").data + random.normal(0, 1e-4, 3)
            _add(camera, {"time": 0.02 * k, "marker_x": x, "marker_y": y, "marker_z": z})
        mujoco.mj_step(model, data, 5)
    return robot, camera


def _add(columns: dict[str, list], cells: dict[str, float]) -> None:
    for name, cell in cells.items():
        columns.setdefault(name, []).append(round(float(cell), 9))


Logs = list[tuple[dict[str, list], dict[str, list]]]
"""Columns of the logs of each episode: (robot, camera) each."""


@pytest.fixture(scope="session")
def lever_logs() -> Logs:
    """Logs of two episodes of the machine: (robot, camera) each."""
    return [_log(4.0, 0.0), _log(4.0, 1.0)]


@pytest.fixture
def study_folder(tmp_path: Path, lever_logs: Logs) -> StudyFolder:
    """A good study in its own folder."""
    return write_lever(tmp_path, lever_logs)


def write_lever(path: Path, lever_logs: Logs) -> StudyFolder:
    """Write the good study with these logs into a folder."""
    logs = {}
    for i, (robot, camera) in enumerate(lever_logs):
        logs[f"robot_{i}.csv"] = {name: list(cells) for name, cells in robot.items()}
        logs[f"camera_{i}.csv"] = {name: list(cells) for name, cells in camera.items()}
    length = {"unit": "m", "noise": 1e-4}
    content = {
        "name": "a lever",
        "model": "lever.xml",
        "episodes": [
            {"commands": f"robot_{i}.csv", "readings": [f"camera_{i}.csv"]} for i in range(2)
        ],
        "time": {"column": "time", "unit": "s"},
        "actuators": {
            "flexor": {"column": "target_flexor", "unit": "m"},
            "extensor": {"column": "target_extensor", "unit": "m"},
        },
        "sensors": {
            "length_flexor": {"column": "length_flexor", **length},
            "length_extensor": {"column": "length_extensor", **length},
            "tension_flexor": {"column": "tension_flexor", "unit": "N", "scale": -1},
            "angle_elbow": {"column": "angle_elbow", "unit": "rad"},
            "marker_position": {"columns": ["marker_x", "marker_y", "marker_z"], **length},
        },
        "initial": {"settle": 1.0},
    }
    (path / "lever.xml").write_text(MODEL, encoding="utf-8")
    folder = StudyFolder(path / "STUDY.yaml", content, logs)
    folder.write()
    return folder


@pytest.fixture
def lever_study(study_folder: StudyFolder) -> Study:
    """The good study, loaded."""
    return load_study(study_folder.path)


@pytest.fixture
def diagnosed(lever_study: Study) -> Callable[[Verdict], Diagnosis]:
    """Makes diagnoses of the good study: friction of the flexor, and an encoder offset."""
    return partial(_diagnosis, lever_study)


STEPS = (
    Share("small deviations within the tolerances", 12.0, 11.0, 0.16),
    Share("Coulomb friction at flexor", 11.0, 4.0, 0.73),
    Share("length offset at extensor", 4.0, 1.5, 0.1),
)
"""Waterfall of the made-up diagnosis."""


def _diagnosis(study: Study, verdict: Verdict) -> Diagnosis:
    system, readings = compile_system(study), measured(study)
    friction = _candidate(system, "coulomb_friction", "flexor")
    offset = _candidate(system, "length_offset", "extensor")
    values = {"friction": 3.0}, {"offset": 0.0025}
    named = verdict.has_names
    parts = list(zip((friction, offset), values, strict=True)) if named else []
    before, after = (
        replay(build(system, found), study, readings).prediction for found in ([], parts)
    )
    estimates = (
        {"friction": Estimate(3.0, 2.5, 3.5, "N")},
        {"offset": Estimate(0.0025, 0.002, 0.003, "m")},
    )
    objection = "leaves errors above the noise"
    reason = "has a parameter at its bound"
    return Diagnosis(
        study=study.name,
        verdict=verdict,
        sentence=f"The verdict is {verdict.value}.",
        causes=_causes((friction, offset), estimates)[: 2 * named],
        fitted_candidates=_fitted_candidates((friction, offset), values, named),
        rms_before=12.0,
        rms_after=1.5 if named else 12.0,
        noise_floor=1.0,
        gain=Gain(0.955, 0.93, 0.97) if named else None,
        unexplained_fraction=0.05,
        explainable_fraction=0.97,
        depends_on=(Dependence("velocity sign of elbow", "length_flexor", 0.4),),
        next_experiment=_experiment(study),
        not_judged=(("camera_focal", "nothing to act on"),),
        traces=_traces(study, readings, before, after),
        effects=((offset, values[1]),) if named else (),
        extended_xml=build(system, parts).spec.to_xml(),
        seconds=12.5,
        criteria=(Criterion("report_noises", 1.5, 1.2, verdict is Verdict.NAMED, objection),),
        waterfall=STEPS if named else (),
        rejected=()
        if verdict in (Verdict.NAMED, Verdict.NOTHING_WRONG)
        else (Rejected(offset, {"offset": -1.154e-18}, reason, Gain(3.0, -1.0, 7.0)),),
        notes=(),
    )


def _causes(
    candidates: tuple[Candidate, Candidate],
    estimates: tuple[dict[str, Estimate], dict[str, Estimate]],
) -> tuple[NamedCause, ...]:
    friction, offset = candidates
    return (
        NamedCause(
            *(friction, estimates[0], 0.93, (), (), Gain(50.0, 30.0, 70.0), STEPS[1]),
            doubts=(Doubt("another known cause in its place", 0.07),),
        ),
        NamedCause(
            *(offset, estimates[1], 0.88, ("length_scale",), (), Gain(9.0, 1.0, 17.0), STEPS[2]),
            doubts=(Doubt("an unknown cause", 0.118), Doubt("chance", 0.002)),
        ),
    )


def _fitted_candidates(
    candidates: tuple[Candidate, Candidate],
    values: tuple[dict[str, float], dict[str, float]],
    named: bool,
) -> tuple[FittedCandidate, ...]:
    friction, offset = candidates
    return (
        FittedCandidate(friction, values[0], 40.0, 0.9, 0, True, 95.0),
        FittedCandidate(offset, values[1], 52.0, 0.1, 0, False, 20.0),
        FittedCandidate(offset, values[1], 60.0, 0.9, 1, named, 80.0),
        FittedCandidate(friction, values[0], -np.inf, 0.0, 1),
    )


def _experiment(study: Study) -> Experiment:
    first = study.episodes[0]
    return Experiment("slow sweeps", "Sweep slowly.", first.time, first.command, 6.0, 1.5)


def _candidate(system: System, id: str, element: str) -> Candidate:
    found = find_cause(id)
    location = next(p for p in found.locations(system) if p.elements == (element,))
    return Candidate(found, location, found.parameters(system, location))


def _traces(
    study: Study, readings: Measured, before: np.ndarray, after: np.ndarray
) -> tuple[Trace, ...]:
    role, traces = split(readings), []
    for e, episode in enumerate(study.episodes):
        for c, channel in enumerate(study.channels):
            at = (readings.episode == e) & (readings.channel == c)
            signals = (readings.value[at], before[at], after[at])
            noise, time = float(readings.noise[at][0]), readings.time[at]
            traces.append(
                Trace(channel.name, episode.name, channel.unit, noise, time, role[at], *signals)
            )
    return tuple(traces)


PLOTS = (
    "residual_map",
    "time_traces",
    "against",
    "channel_gain",
    "waterfall",
    "candidate_evidence",
    "remainder",
    "commands",
    "intervals",
    "log_intervals",
)
"""Functions that make the figures of a page."""


@pytest.fixture
def blank_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skips the rendering of pictures, which takes long."""
    monkeypatch.setattr("reality_gap.report.html.png", lambda figure: "")


@pytest.fixture
def no_figures(blank_pictures: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Skips the figures of pictures, too: texts take hardly any time."""
    for name in PLOTS:
        monkeypatch.setattr(f"reality_gap.report.html.{name}", lambda *arguments: None)


@pytest.fixture
def one_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes the evidence of linear effects exact."""
    monkeypatch.setattr(evidence, "SIZES", (PRIOR,))
