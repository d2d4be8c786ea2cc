"""What was learned is written whole, continues to the bit, and is refused where it does not fit."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MUSCLE_ABSENT, MUSCLE_UNSTABLE, MUSCLES_SWAPPED
from jmm_agent.mapping.array_file import ArrayFileError, read_arrays, write_arrays
from jmm_agent.mapping.group_map import ARRAYS, Layers
from jmm_agent.mapping.joint_muscle_map import CheckpointError, JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.memory_file import (
    SHAPES,
    AgentMemory,
    generator_of,
    read_memory,
    write_memory,
)
from jmm_agent.updaters import AntagonismMemory, VisionMemory
from jmm_agent.updaters.assignment import Assignment
from jmm_agent.updaters.rest_fitter import RestMemory
from jmm_agent.updaters.wiring_evidence import Miswiring
from jmm_agent.vision.hold_out import HoldOutMemory
from jmm_agent.vision.length_drift import LengthDrift
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.pose_errors import JointPrior
from jmm_agent.vision.prior_widths import PriorWidths
from jmm_agent.vision.rest_fit import Rest
from tests.jmm_agent.small_map import JOINTS, MUSCLES, make_map

N, M, K = len(JOINTS), len(MUSCLES), 3
NAMED = (
    Miswiring(MUSCLES_SWAPPED, (0, 4)),
    Miswiring(MUSCLE_ABSENT, (3,)),
    Miswiring(MUSCLE_UNSTABLE, (1,)),
)
WIRED = Assignment((4, 1, 2, 3, 0), (3,), NAMED)
"""Two muscles are exchanged, one is left out, and one is named only."""


def measure(observations: list[MarkerObservation], rng: np.random.Generator) -> None:
    """Let three observations have all that may be measured."""
    measured = {"frames": ("grip", None), "covariance": np.diag(rng.uniform(1.0, 2.0, 6))}
    angles = np.where(np.arange(N) == 1, np.nan, rng.normal(size=N))
    observations[0] = observations[0]._replace(**measured)
    observations[2] = observations[2]._replace(tensions=rng.uniform(0.0, 9.0, M))
    observations[1] = observations[1]._replace(frames=("grip", "eye"), joint_angles=angles)


OF_WIRING = "camera", "in_use", "channels", "left_out", "miswired"


def made_up(seed: int = 0, count: int = K, nominal: int = 0) -> AgentMemory:
    """A memory of a small map's robot, with random numbers in all that can be learned."""
    rng = np.random.default_rng(seed)

    def pairs(rows: int) -> Pairs:
        return Pairs(rng.normal(size=(rows, N)), rng.normal(size=(rows, M)), np.full(rows, 0.001))

    observations = [
        MarkerObservation(rng.normal(size=(4, 4)), rng.normal(size=M), rng.normal(size=N))
        for _ in range(count)
    ]
    if count > 1:
        measure(observations, rng)
    vision = VisionMemory(
        observations,
        list(rng.normal(size=(count, M))),
        [bool(k % 2) for k in range(count)],
        rng.normal(size=(count, N)),
        rng.integers(0, 3, (count, M)).astype(float),
        pairs(count),
        rests=RestMemory(
            rng.normal(size=N),
            PriorWidths(0.001, 0.002, 0.3, 0.005),
            tuple(Rest(*(rng.normal(size=size) for size in (M, M, N))) for _ in range(count)),
            7.5,
            rng.normal(size=8),
            LengthDrift(2e-5, np.sort(rng.uniform(0.0, 90.0, count))[::-1]),
            JointPrior(0.001, 0.02),
        )
        if count
        else RestMemory(),
        assignment=WIRED if count > 1 else Assignment(),
    )
    if count > 1:  # a muscle was out of use
        vision.observations[1].lengths[3] = vision.commands[1][3] = np.nan
        vision.pairs.lengths[1, 3] = np.nan
    moved = make_map(nominal)
    layers = {
        g.name: Layers(*(layer + rng.normal(size=layer.shape) for layer in g.layers))
        for g in moved.groups
    }
    return AgentMemory(
        moved.with_layers(layers),
        AntagonismMemory(rng.normal(size=N) if count else None, pairs(count)),
        vision,
        HoldOutMemory(7, 1, pairs(2)),
        rng.normal(size=N),
        dict(rng.bit_generator.state),
        np.array([1.0, 1.0, 0.5, 0.0, 1.0]) if count > 1 else None,
    )


def plain(memory: Any) -> Any:
    """Content of a memory as nested lists."""
    if isinstance(memory, JointMuscleMap):
        return [[getattr(g, part).tolist() for part in ARRAYS] for g in memory.groups]
    if isinstance(memory, np.ndarray):
        return repr(memory.tolist())
    return [plain(part) for part in memory] if isinstance(memory, tuple | list) else memory


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "learned.npz"
    write_memory(path, made_up(), make_map())
    return path


@pytest.mark.parametrize("count", [0, 1, K])
def test_what_is_written_is_read_to_the_bit(count: int, tmp_path: Path) -> None:
    memory = made_up(count=count)
    write_memory(tmp_path / "new" / "learned.npz", memory, make_map())
    found = read_memory(tmp_path / "new" / "learned.npz", make_map())
    assert plain(found) == plain(memory)
    assert generator_of(found.generator).normal() == generator_of(memory.generator).normal()
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["learned.npz"]


@pytest.mark.parametrize(
    ("version", "without"),
    [
        (3, ("misplaced", "drift", "ages", *OF_WIRING)),
        (4, ("misplaced", "drift", "ages")),
        (5, ("misplaced",)),
    ],
)
def test_a_file_of_an_earlier_format_is_read(
    version: int, without: tuple[str, ...], path: Path
) -> None:
    arrays = read_arrays(path, 1 << 20)
    for name in without:
        del arrays[name]
    if version < 5:
        arrays["widths"] = arrays["widths"][:, :3]
    write_arrays(path, arrays | {"format": np.array(f"agent-memory-{version}")})
    found, whole = read_memory(path, make_map()), made_up()
    assert found.vision.rests.widths == PriorWidths(
        0.001, 0.002, 0.3, pytest.approx(0.001 * 4.0 / 3.0) if version < 5 else 0.005
    )
    assert found.vision.rests.joints is None
    if version < 5:
        assert found.vision.rests.drift.speed == 0.0
        assert found.vision.rests.drift.ages.tolist() == [0.0] * K
    if version == 3:
        assert (found.in_use, found.vision.rests.camera) == (None, None)
        assert found.vision.assignment == Assignment()
    else:
        assert plain(found.in_use) == plain(whole.in_use)
        assert plain(found.vision.assignment) == plain(whole.vision.assignment)
    assert plain(found.vision.pairs) == plain(whole.vision.pairs)
    assert plain(found.map) == plain(whole.map)


def test_a_map_of_which_the_file_would_lose_something_is_refused(tmp_path: Path) -> None:
    memory = made_up()
    near, far = memory.map.groups
    for changed in (replace(near, scale=2.0 * near.scale), replace(near, name="nearer")):
        other = replace(memory.map, groups=(changed, far))
        with pytest.raises(AgentError, match=r"joints, muscles or scales, too|unknown group"):
            write_memory(tmp_path / "learned.npz", memory._replace(map=other), make_map())
        assert not (tmp_path / "learned.npz").exists()


def test_frames_that_the_robot_does_not_have_are_refused(path: Path) -> None:
    read_memory(path, make_map(), ("eye", "grip"))
    with pytest.raises(CheckpointError, match="poses of grip, which is no frame of this robot"):
        read_memory(path, make_map(), ("eye",))


def test_every_part_of_an_observation_is_kept() -> None:
    assert set(MarkerObservation._fields) <= set(SHAPES)


def test_generators_of_other_kinds_continue_too(tmp_path: Path) -> None:
    rng = np.random.Generator(np.random.MT19937(3))
    memory = made_up()._replace(generator=dict(rng.bit_generator.state))
    write_memory(tmp_path / "learned.npz", memory, make_map())
    found = read_memory(tmp_path / "learned.npz", make_map())
    assert generator_of(found.generator).normal() == rng.normal()


def rewritten(path: Path, **arrays: np.ndarray) -> None:
    write_arrays(path, read_arrays(path, 1 << 20) | arrays)


def nan(path: Path) -> None:
    pose = np.zeros((K, 4, 4))
    pose[1, 2, 3] = np.nan
    rewritten(path, pose=pose)


def infinite_layer(path: Path) -> None:
    rewritten(path, b2_0=np.full(len(make_map().groups[0].b2), np.inf))


def shape(path: Path) -> None:
    rewritten(path, guess=np.zeros((K, N + 1)))


def fewer_observations(path: Path) -> None:
    rewritten(path, commands=np.zeros((K - 1, M)))


def layer_shape(path: Path) -> None:
    rewritten(path, W2_1=np.zeros((2, 2)))


def text_for_numbers(path: Path) -> None:
    rewritten(path, posture=np.array(["a"] * N))


def half_a_covariance(path: Path) -> None:
    covariance = np.full((K, 6, 6), np.nan)
    covariance[0, :3, :3] = np.eye(3)
    rewritten(path, covariance=covariance)


def missing(path: Path) -> None:
    arrays = read_arrays(path, 1 << 20)
    del arrays["elongated"]
    write_arrays(path, arrays)


def other_joints(path: Path) -> None:
    rewritten(path, joints=np.array([*JOINTS[:-1], "e"]))


def fewer_muscles(path: Path) -> None:
    rewritten(path, muscles=np.array(MUSCLES[:-1]))


def twice_a_channel(path: Path) -> None:
    rewritten(path, channels=np.array([4, 1, 2, 3, 4]))


def unknown_kind(path: Path) -> None:
    rewritten(path, miswired=np.array([[9, 0, 0]]))


def unknown_muscle(path: Path) -> None:
    rewritten(path, miswired=np.array([[0, 0, 5]]))


def half_in_use(path: Path) -> None:
    rewritten(path, in_use=np.array([1.0, 0.7, 1.0, 1.0, 1.0]))


def none_in_use(path: Path) -> None:
    rewritten(path, in_use=np.zeros(5))


def two_cameras(path: Path) -> None:
    rewritten(path, camera=np.zeros((2, 8)))


def misplaced_twice(path: Path) -> None:
    rewritten(path, misplaced=np.ones((2, 2)))


def misplaced_backwards(path: Path) -> None:
    rewritten(path, misplaced=np.array([[0.001, -0.02]]))


def other_format(path: Path) -> None:
    rewritten(path, format=np.array("agent-memory-0"))


def earlier_format(path: Path) -> None:
    rewritten(path, format=np.array("agent-memory-2"))


def no_hidden_layer(path: Path) -> None:
    arrays = read_arrays(path, 1 << 20)
    del arrays["b1_1"]
    write_arrays(path, arrays)


def other_nominal_map(path: Path) -> None:
    write_memory(path, made_up(nominal=1), make_map(seed=1))


def no_noise(path: Path) -> None:
    rewritten(path, vision_noise=np.zeros(K))


def generator(path: Path) -> None:
    rewritten(path, generator=np.array('{"bit_generator": "PCG64", "state": 3}'))


def other_class(path: Path) -> None:
    rewritten(path, generator=np.array('{"bit_generator": "load", "state": 3}'))


def cut_off(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])


def empty(path: Path) -> None:
    path.write_bytes(b"")


def text(path: Path) -> None:
    path.write_text("learned: everything")


def map_only(path: Path) -> None:
    make_map().save(path)


def gone(path: Path) -> None:
    path.unlink()


def folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


REFUSED: dict[Callable[[Path], None], str] = {
    nan: "pose has a number that is not finite",
    infinite_layer: "b2 has a number that is not finite",
    shape: r"guess has shape \(3, 5\), but \(3, 4\) fits",
    fewer_observations: r"commands has shape \(2, 5\), but \(3, 5\) fits",
    layer_shape: "W2 has shape",
    text_for_numbers: "posture holds <U1, which does not fit",
    half_a_covariance: "covariance",
    missing: "the array 'elongated' is missing",
    other_joints: r"its joints \(4: a, b, c, e\) are not this robot's 4 joints",
    fewer_muscles: "its muscles .* are not this robot's 5 muscles",
    twice_a_channel: "its wiring is that of no robot",
    unknown_kind: "its wiring is that of no robot",
    unknown_muscle: "its wiring is that of no robot",
    half_in_use: "in_use has a number that is not 0, 0.5 or 1",
    none_in_use: "in_use has .* no muscle in use",
    two_cameras: "camera has 2 rows, but one fits",
    misplaced_twice: "misplaced has 2 rows, but one fits",
    misplaced_backwards: "misplaced has a negative number",
    other_format: "its format is agent-memory-0, and agent-memory-6 is read",
    earlier_format: "its format is agent-memory-2, which lacks the hidden layers .*; learn again",
    no_hidden_layer: "the array 'b1_1' of numbers is missing",
    other_nominal_map: "another nominal map",
    no_noise: "vision_noise has a number that is not positive",
    generator: "the state of its random generator is damaged",
    other_class: "the state of its random generator is damaged",
    cut_off: "cut off or damaged",
    empty: "cut off or damaged",
    text: "cut off or damaged",
    map_only: "its format is jmm-1",
    gone: "there is no such file",
    folder: "is a folder; name the file in it",
}


@pytest.mark.parametrize("damage", REFUSED, ids=lambda damage: damage.__name__)
def test_a_file_that_does_not_fit_is_refused_in_one_sentence(
    damage: Callable[[Path], None], path: Path
) -> None:
    damage(path)
    with pytest.raises(CheckpointError, match=REFUSED[damage]) as caught:
        read_memory(path, make_map())
    message = str(caught.value)
    assert str(path) in message
    assert message.endswith(".")
    assert "\n" not in message
    assert len(message) < 400
    assert isinstance(caught.value, AgentError)


def header(shape: str) -> bytes:
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def packed(path: Path, packing: int, mib: int) -> None:
    """Write an archive with one array of zeros of a size."""
    with zipfile.ZipFile(path, "w", packing) as archive, archive.open("pose.npy", "w") as file:
        file.write(header(f"({mib << 17},)"))
        for _ in range(mib):
            file.write(bytes(1 << 20))


@pytest.mark.parametrize(
    ("packing", "mib", "reason"),
    [
        (zipfile.ZIP_DEFLATED, 80, "unfolds into 80 MiB, and 64 are allowed"),
        (zipfile.ZIP_BZIP2, 1, "is not deflate"),
        (zipfile.ZIP_LZMA, 1, "is not deflate"),
    ],
)
def test_an_archive_that_unfolds_too_far_is_refused_before_it_is_unfolded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, packing: int, mib: int, reason: str
) -> None:
    path = tmp_path / "bomb.npz"
    packed(path, packing, mib)
    monkeypatch.setattr(zipfile.ZipFile, "open", None)
    for read in (JointMuscleMap.load, lambda path: read_memory(path, make_map())):
        with pytest.raises(CheckpointError, match=reason):
            read(path)


@pytest.mark.parametrize("shown", [100, 1 << 31])
def test_an_archive_that_declares_a_wrong_size_is_refused(tmp_path: Path, shown: int) -> None:
    path = tmp_path / "bomb.npz"
    packed(path, zipfile.ZIP_DEFLATED, 1)
    content = path.read_bytes()
    true = ((1 << 20) + len(header("(131072,)"))).to_bytes(4, "little")
    assert content.count(true) == 2  # beside the array, and in the directory
    path.write_bytes(content.replace(true, shown.to_bytes(4, "little")))
    with pytest.raises(ArrayFileError, match=r"declares|unfolds into 2048 MiB|damaged"):
        read_arrays(path, 64 << 20)


@pytest.mark.parametrize("shape", ["(268435456,)", "(268435456, 0)", "(-1,)", "(2,)", "()"])
def test_a_header_that_declares_other_sizes_than_the_archive_is_refused(
    tmp_path: Path, shape: str
) -> None:
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("pose.npy", header(shape) + bytes(24))
    with pytest.raises(ArrayFileError, match=r"its header declares|damaged"):
        read_arrays(path, 1 << 20)


def test_pickles_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "pickle.npz", pose=np.array([{}], dtype=object))
    with pytest.raises(ArrayFileError, match="object"):
        read_arrays(tmp_path / "pickle.npz", 1 << 20)


def test_names_that_occur_twice_are_refused(tmp_path: Path) -> None:
    content = header("(1,)") + bytes(8)
    with zipfile.ZipFile(tmp_path / "twice.npz", "w") as archive:
        archive.writestr("pose.npy", content)
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("pose.npy", content)
    with pytest.raises(ArrayFileError, match="two arrays of the same name"):
        read_arrays(tmp_path / "twice.npz", 1 << 20)


KILLED = """
import os, signal, sys
import numpy as np
from tests.jmm_agent.small_map import make_map
from tests.jmm_agent.test_memory_file import made_up
from jmm_agent.memory_file import write_memory

if sys.argv[2] == "writing":
    def savez(file, **arrays):
        file.write(b"PK half of it")
        file.flush()
        os.kill(os.getpid(), signal.SIGKILL)
    np.savez = savez
else:
    os.replace = lambda *paths: os.kill(os.getpid(), signal.SIGKILL)
write_memory(sys.argv[1], made_up(seed=1), make_map())
"""


@pytest.mark.parametrize("moment", ["writing", "renaming"])
def test_killed_in_the_middle_of_saving_leaves_the_old_file(path: Path, moment: str) -> None:
    before = path.read_bytes()
    ended = subprocess.run(
        [sys.executable, "-c", KILLED, str(path), moment],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        cwd=Path(__file__).parents[2],
        check=False,
    )
    assert ended.returncode == -signal.SIGKILL
    assert path.read_bytes() == before
    assert plain(read_memory(path, make_map())) == plain(made_up())


def test_file_and_folder_are_flushed(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flushed: list[bool] = []
    fsync = os.fsync

    def noted(handle: int) -> None:
        flushed.append(stat.S_ISDIR(os.fstat(handle).st_mode))
        fsync(handle)

    monkeypatch.setattr(os, "fsync", noted)
    write_memory(path, made_up(), make_map())
    assert flushed == [False, True]


def test_arrays_in_columns_are_read_as_they_are(tmp_path: Path) -> None:
    array = np.arange(24.0).reshape(2, 3, 4)
    write_arrays(tmp_path / "columns.npz", {"pose": np.asfortranarray(array)})
    np.testing.assert_array_equal(read_arrays(tmp_path / "columns.npz", 1 << 20)["pose"], array)
