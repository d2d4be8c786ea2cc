"""Tasks on a real Ray cluster: a head and two nodes on loopback, one of which is killed."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import ray
from ray import cloudpickle
from ray.cluster_utils import Cluster

from experiments.harness.cluster import on_cluster
from experiments.harness.errors import ExperimentError
from experiments.harness.runner import run_tasks, timed

TASKS = {f"t{seed}": (seed,) for seed in range(10)}


def swing(seed: int) -> list[float]:
    """Where an actual elbow ends: numbers that the last bit of its physics decides."""
    import gymnasium as gym

    env = gym.make("kengoro_env:Kengoro/Elbow-v0", robot_seed=seed)
    observation, _ = env.reset(seed=seed)
    for _ in range(30):
        observation, *_ = env.step(env.action_space.low)
    time.sleep(0.3)
    return [*map(float, observation["lengths"]), *map(float, observation["tensions"])]


def refuse(seed: int) -> None:
    """Fails, wherever it runs."""
    raise ValueError(f"no swing {seed}")


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """A head that does no work, and two nodes of one core each."""
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    found = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False}
    )
    for _ in range(2):
        found.add_node(num_cpus=1)
    yield found
    found.shutdown()


@pytest.mark.slow
def test_a_node_that_dies_changes_no_bit(cluster: Cluster, tmp_path: Path) -> None:
    alone = run_tasks(swing, TASKS, 1, tmp_path / "alone", "key")
    victim = cluster.add_node(num_cpus=1)
    found = {}

    for name, result, _ in on_cluster(cluster.address, timed, swing, TASKS):
        found[name] = result
        if len(found) == 2:
            cluster.remove_node(victim, allow_graceful=False)

    assert found == alone
    assert not ray.is_initialized()


@pytest.mark.slow
def test_what_a_cluster_did_is_kept_like_anything_else(cluster: Cluster, tmp_path: Path) -> None:
    few = {name: TASKS[name] for name in ("t0", "t1")}
    found = run_tasks(swing, few, 1, tmp_path, "key", cluster.address)
    assert found == run_tasks(refuse, few, 1, tmp_path, "key")
    with pytest.raises(ValueError, match="no swing 0"):
        run_tasks(refuse, {"t0": (0,)}, 1, tmp_path, "another key", cluster.address)


def test_where_all_is_done_no_cluster_is_asked(tmp_path: Path) -> None:
    done = run_tasks(pow, {"t": (2, 3)}, 1, tmp_path, "key")
    assert run_tasks(pow, {"t": (2, 3)}, 1, tmp_path, "key", "nowhere") == done


@pytest.mark.parametrize("address", ["127.0.0.1:1", "ray://127.0.0.1:1", "nowhere"])
def test_no_cluster_is_one_sentence(address: str) -> None:
    with pytest.raises(ExperimentError, match=f"No Ray cluster answers at '{address}': .*"):
        next(on_cluster(address, timed, swing, TASKS))
