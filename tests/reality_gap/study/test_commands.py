"""Commands: models with actuators that take no command, or more than one."""

from __future__ import annotations

from itertools import product

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from reality_gap.causes import CATALOGUE
from reality_gap.check import check_study
from reality_gap.diagnosis import Experiment
from reality_gap.errors import StudyError
from reality_gap.inference.remainder import _quantities
from reality_gap.io.loader import load_study
from reality_gap.report.plots.commands import commands
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import replay
from reality_gap.study.measurements import measured
from reality_gap.study.system import System, command_limits, compile_system
from tests.reality_gap.conftest import MODEL, Logs, StudyFolder, write_lever

BRAKE = (
    '<dcmotor name="brake" joint="elbow" motorconst="0 0" resistance="1" input="none" '
    'lugre="200 1 0.5 0.5 0.01"/>'
)
PID = '<pid name="servo" joint="elbow" input="{}"/>'
BEGIN, END = "<actuator>", "</actuator>"


def study(folder: StudyFolder, model: str) -> System:
    (folder.path.parent / "lever.xml").write_text(model, encoding="utf-8")
    return compile_system(load_study(folder.path))


def first(study_folder: StudyFolder) -> System:
    """The lever with a passive brake, which comes before its motors."""
    return study(study_folder, MODEL.replace(BEGIN, BEGIN + BRAKE))


def last(study_folder: StudyFolder) -> System:
    """The lever with a passive brake, which comes after its motors."""
    return study(study_folder, MODEL.replace(END, BRAKE + END))


def predict(
    system: System, candidate: Candidate | None = None, share: float = 1.0
) -> NDArray[np.float64]:
    parts = []
    if candidate is not None:
        values = {
            p.name: p.null + share * (p.hints.starts[0] - p.null if p.hints.starts else p.scale)
            for p in candidate.parameters
        }
        parts = [(candidate, values)]
    return replay(build(system, parts), system.study, measured(system.study)).prediction


@pytest.fixture(scope="module")
def braked(tmp_path_factory: pytest.TempPathFactory, lever_logs: Logs) -> tuple[System, System]:
    """The lever with its brake first, and last; in logs of a second.

    In a folder each, as a model is loaded once.
    """
    short = [
        (first_seconds(robot, 1.0), first_seconds(camera, 1.0)) for robot, camera in lever_logs
    ]
    folders = [write_lever(tmp_path_factory.mktemp(name), short) for name in ("first", "last")]
    return first(folders[0]), last(folders[1])


def first_seconds(columns: dict[str, list], seconds: float) -> dict[str, list]:
    count = sum(time < seconds for time in columns["time"])
    return {name: cells[:count] for name, cells in columns.items()}


def test_the_model_does_not_depend_on_the_position_of_an_actuator_without_input(
    braked: tuple[System, System],
) -> None:
    one, other = (predict(system) for system in braked)
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("id", sorted(CATALOGUE))
def test_the_position_of_an_actuator_without_input_does_not_matter(
    braked: tuple[System, System], id: str
) -> None:
    before, after = braked
    locations = CATALOGUE[id].locations(before)
    assert locations == CATALOGUE[id].locations(after)
    candidates = [
        Candidate(CATALOGUE[id], location, CATALOGUE[id].parameters(before, location))
        for location in locations
    ]
    # A small delay acts on the command, a larger one in the actuator.
    for candidate, share in product(candidates, (1.0, 0.1)):
        one, other = (predict(system, candidate, share) for system in (before, after))
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9, err_msg=str(candidate))


def test_check_study_accepts_an_actuator_without_input(braked: tuple[System, System]) -> None:
    one, other = (check_study(system.study) for system in braked)
    assert one == other
    assert [system.model.actuator("brake").id for system in braked] == [0, 2]
    for system in braked:
        assert [tendon.actuator for tendon in system.tendons] == ["flexor", "extensor"]


def test_remainder_and_next_experiment_name_commanded_actuators(
    study_folder: StudyFolder,
) -> None:
    system = first(study_folder)
    readings = measured(system.study)
    records = replay(build(system, []), system.study, readings).records
    forces = [name for name, _ in _quantities(records, readings) if name.startswith("force")]
    assert forces == ["force of flexor", "force of extensor"]
    time = np.arange(3.0)
    command = np.column_stack([0.1 * time, 0.2 * time])
    picture = commands(Experiment("", "", time, command, 2.0, 1.0), system.model)
    _, labels = picture.axes[0].get_legend_handles_labels()
    assert labels == ["flexor [mm]", "extensor [mm]"]


@pytest.mark.parametrize("begin", [True, False])
@pytest.mark.parametrize("inputs", ["pos vel", "pos vel ff"])
def test_an_actuator_with_several_inputs_is_refused(
    study_folder: StudyFolder, begin: bool, inputs: str
) -> None:
    pid = PID.format(inputs)
    model = MODEL.replace(BEGIN, BEGIN + pid) if begin else MODEL.replace(END, pid + END)
    with pytest.raises(StudyError, match=f"'servo' .* takes {len(inputs.split())} inputs"):
        study(study_folder, model)


def test_limits_of_commands_are_those_of_the_actuator() -> None:
    """MuJoCo has them by input, and a brake has none."""
    limited = '<motor name="limited" joint="elbow" ctrlrange="-2 3"/>'
    free = '<motor name="free" joint="elbow"/>'
    text = MODEL.replace(BEGIN, f"{BEGIN}{BRAKE}{limited}{BRAKE.replace('brake', 'other')}{free}")
    model = mujoco.MjModel.from_xml_string(text)
    found = {
        name: command_limits(model, model.actuator(name).id)
        for name in ("brake", "limited", "other", "free")
    }
    none = (-np.inf, np.inf)
    assert found == {"brake": none, "limited": (-2.0, 3.0), "other": none, "free": none}
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
    assert command_limits(model, model.actuator("limited").id) == none
