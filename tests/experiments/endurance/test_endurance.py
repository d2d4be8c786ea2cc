"""Continuous learning in parts: checkpoints keep the state of the agent between them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.endurance import run
from experiments.endurance.run import Args, hourly, main
from experiments.harness.errors import ExperimentError
from jmm_agent.agent import Agent
from jmm_agent.mapping.joint_muscle_map import CheckpointError
from jmm_agent.mapping.learner import Pairs
from jmm_agent.updaters import AntagonismMemory, VisionMemory
from jmm_agent.vision.observation_fit import MarkerObservation
from kengoro.agents import make_agent


@pytest.fixture(scope="module")
def agents(cache: Path) -> tuple[Agent, Agent]:
    """Two agents whose memories tests may change."""
    return make_agent(0, cache=cache), make_agent(1, cache=cache)


@pytest.fixture(scope="module")
def cache(request: pytest.FixtureRequest) -> Path:
    """Folder of a map that is trained once and kept between test runs."""
    return Path(request.config.cache.mkdir("maps"))


def made_up(rng: np.random.Generator) -> tuple[AntagonismMemory, VisionMemory]:
    """Memories of three observations."""

    def pairs() -> Pairs:
        return Pairs(rng.normal(size=(3, 14)), rng.normal(size=(3, 36)), rng.uniform(size=3))

    observations = [
        MarkerObservation(rng.normal(size=(4, 4)), rng.normal(size=36), rng.normal(size=14))
        for _ in range(3)
    ]
    vision = VisionMemory(
        observations,
        [rng.normal(size=36) for _ in range(3)],
        [True, False, True],
        rng.normal(size=(3, 14)),
        rng.integers(0, 3, (3, 36)).astype(float),
        pairs(),
    )
    return AntagonismMemory(rng.normal(size=14), pairs()), vision


def plain(memory: Any) -> Any:
    """Content of a memory as nested lists."""
    if isinstance(memory, np.ndarray):
        return memory.tolist()
    return [plain(part) for part in memory] if isinstance(memory, tuple | list) else memory


def test_what_an_agent_knows_survives_in_a_file(
    agents: tuple[Agent, Agent], tmp_path: Path
) -> None:
    agent, other = agents
    group = agent.map.groups[0]
    layers = {group.name: (group.W2 + 1.0, group.b2 - 1.0)}
    agent.recall(agent.map.with_output_layers(layers), *made_up(np.random.default_rng(0)))
    agent.learner.rng.normal(size=5)
    agent.save(tmp_path / "memory.npz")
    other.load(tmp_path / "memory.npz")
    np.testing.assert_array_equal(other.map.groups[0].W2, group.W2 + 1.0)
    np.testing.assert_array_equal(other.map.groups[0].b2, group.b2 - 1.0)
    assert other.learner.rng.normal() == agent.learner.rng.normal()
    assert plain(other.antagonism.memory) == plain(agent.antagonism.memory)
    assert plain(other.vision.memory) == plain(agent.vision.memory)
    assert list(tmp_path.iterdir()) == [tmp_path / "memory.npz"]


def test_an_agent_that_has_learned_nothing_can_be_kept(
    agents: tuple[Agent, Agent], tmp_path: Path
) -> None:
    agent, other = agents
    none = Pairs.none(14, 36)
    nothing = VisionMemory([], [], [], np.empty((0, 14)), np.empty((0, 36)), none)
    agent.recall(agent.map, AntagonismMemory(None, none), nothing)
    agent.save(tmp_path / "memory.npz")
    other.load(tmp_path / "memory.npz")
    assert other.antagonism.memory.last is None
    assert other.vision.memory.observations == []


@pytest.mark.parametrize("content", [b"", b"nonsense", b"PK\x03\x04 no archive", None])
def test_a_file_without_a_memory_is_refused(
    content: bytes | None, agents: tuple[Agent, Agent], tmp_path: Path
) -> None:
    path = tmp_path / "memory.npz"
    if content is not None:
        path.write_bytes(content)
    before = agents[0].memory
    with pytest.raises(CheckpointError, match="does not hold what this agent has learned"):
        agents[0].load(path)
    assert agents[0].memory.map is before.map
    assert agents[0].memory.generator == before.generator
    assert plain(agents[0].memory[1:3]) == plain(before[1:3])


def test_errors_are_taken_by_the_hour() -> None:
    parts = [{"error_mm": float(error)} for error in (9, 5, 4, 4, 3, 3, 3, 3, 9, 2, 2, 2)]
    assert hourly(parts, 1800.0) == [7.0, 4.0, 3.0, 3.0, 5.5, 2.0]
    assert hourly(parts[:3], 600.0) == [9.0, 5.0, 4.0]


@pytest.mark.parametrize("wrong", [{"jobs": 3}, {"hours": 0.0}, {"patience": -1.0}])
def test_invalid_options_are_refused(wrong: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(ExperimentError):
        main(replace(Args(out=tmp_path), **wrong))


@pytest.mark.parametrize("damage", ["", "{ broken", '{"key": "key"}'])
def test_a_part_that_is_not_whole_is_lived_again(
    damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def live(args: Args, seed: int, number: int, seconds: float, *files: Path) -> dict[str, Any]:
        files[1].parent.mkdir(parents=True, exist_ok=True)
        files[1].write_bytes(b"memory")
        lived.append(number)
        return {"error_mm": 1.0}

    lived: list[int] = []
    monkeypatch.setattr(run, "run_part", live)
    args = Args(out=tmp_path)
    for number in (0, 1, 1):
        assert run.saved_or_run(args, 0, number, 30.0, "key") == {"error_mm": 1.0}
    assert lived == [0, 1]
    (tmp_path / "robot-000" / "001.json").write_text(damage)
    run.saved_or_run(args, 0, 1, 30.0, "key")
    run.saved_or_run(args, 0, 1, 30.0, "another key")
    assert lived == [0, 1, 1, 1]


@pytest.mark.slow
def test_a_run_goes_on_where_it_was_stopped(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    args = Args(out=tmp_path, cache=cache, quick=True)
    first = main(args)
    parts = first["per_seed"]["0"]["parts"]
    assert [part["observations"] for part in parts] == sorted(
        part["observations"] for part in parts
    )
    assert (
        parts[1]["observations"] > parts[1]["updates"] > 0
    )  # it remembers looks of the first part
    (tmp_path / "robot-000" / "001.json").unlink()
    lived = []
    live = run.run_part

    def noted(*arguments: Any) -> dict[str, Any]:
        lived.append(arguments[2])
        return live(*arguments)

    monkeypatch.setattr(run, "run_part", noted)
    again = main(args)
    assert lived == [1]
    assert again["core_s"] > 1.2 * again["wall_s"]  # the first part was there
    for one, two in zip(parts, again["per_seed"]["0"]["parts"], strict=True):
        assert one == two
    assert (tmp_path / "report.html").is_file()
