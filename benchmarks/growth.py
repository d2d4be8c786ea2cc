"""How cost grows with the work: wires, environments, length of a log, number of causes.

Four panels in ``out/growth.png``, each with the exponent of a power law fitted to what was
measured, and its 95 % interval. Wires: one robot, of which wires are left out or doubled, without
gravity so that no joint falls to its stop. Environments: `make_vec` on one thread. Diagnoses: of
the elbow with one hidden effect, on one core, without a look for the next experiment. All times are
those on the CPU, which a busy machine changes less than the clock.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import NamedTuple

import gymnasium as gym
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import linregress, t

from experiments.gap_bench.trial import Case, write_case
from experiments.harness.report import png
from kengoro_env.assets import asset_path
from kengoro_env.robot.draft import Draft, TendonSpec
from kengoro_env.robot.robot import Robot
from kengoro_env.vector import KengoroVectorEnv
from mjcf_sandbox.files import write_bytes
from reality_gap import CATALOGUE, Options, diagnose, load_study

OUT = Path("out/growth.png")
SCENE = "mjcf/kengoro_arm/posture.xml"
MUSCLES = (9, 18, 36, 72, 144)
ENVIRONMENTS = (1, 4, 16, 64)
ROUNDS, STEPS = 7, 10

HIDDEN = Case("single", 32)
"""A motor of the elbow lags."""

SECONDS = (2.5, 5.0, 10.0, 20.0)
CAUSES = (3, 7, 14, 28)
SHORT = 2.5
"""Length of the log that is diagnosed with few causes and with many [s]."""


class Measured(NamedTuple):
    """Times of the same work, much of it or little.

    Attributes:
        work, unit: what grows, and what it is counted in.
        cost: what the times are of.
        sizes: how much work (k,).
        times: how long it took on the CPU (k,) [s].
    """

    work: str
    unit: str
    cost: str
    sizes: Sequence[float]
    times: Sequence[float]


class PowerLaw(NamedTuple):
    """time = factor size^exponent, with the 95 % interval of the exponent."""

    factor: float
    exponent: float
    low: float
    high: float

    @classmethod
    def of(cls, sizes: Sequence[float], times: Sequence[float]) -> PowerLaw:
        """Least squares of the logarithms; at least three sizes."""
        line = linregress(np.log(sizes), np.log(times))
        half = float(t.ppf(0.975, len(sizes) - 2) * line.stderr)
        slope = float(line.slope)
        return cls(float(np.exp(line.intercept)), slope, slope - half, slope + half)

    def __str__(self) -> str:
        return f"{self.exponent:.2f} [{self.low:.2f}, {self.high:.2f}]"


@dataclass(frozen=True)
class Muscles:
    """A robot with ``count`` wires: some of the drawing's, or all and copies beside them."""

    count: int

    def edit(self, draft: Draft) -> None:
        """See `kengoro_env.robot.draft.Departure`."""
        spec, drawn = draft.spec, list(draft.tendons)
        spec.option.gravity = np.zeros(3)
        kept = {drawn[i * len(drawn) // self.count] for i in range(self.count)}
        for name in set(drawn) - kept:
            spec.delete(spec.tendon(name))
            del draft.tendons[name]
        for number in range(len(drawn), self.count):
            original = spec.tendon(drawn[number % len(drawn)])
            copy = spec.add_tendon(original.default(), name=f"{original.name}_{number}")
            for element in original.path:
                copy.wrap_site(element.target.name)
            draft.tendons[copy.name] = TendonSpec()


def medians(works: Sequence[Callable[[], object]]) -> list[float]:
    """Median CPU time of each work [s], all of them in turns."""
    taken = np.empty((ROUNDS, len(works)))
    for round_ in range(ROUNDS):
        for number, work in enumerate(works):
            begin = process_time()
            for _ in range(STEPS):
                work()
            taken[round_, number] = (process_time() - begin) / STEPS
    return [float(seconds) for seconds in np.median(taken, axis=0)]


def over_muscles() -> Measured:
    """A control step of robots with few wires and many, its senses included."""

    def step_of(robot: Robot) -> Callable[[], object]:
        held = robot.target

        def work() -> None:
            robot.step(held)
            robot.measured_lengths()
            robot.measured_tensions()

        return work

    robots = [Robot(asset_path(SCENE), [Muscles(count)]) for count in MUSCLES]
    times = medians([step_of(robot) for robot in robots])
    return Measured("muscles", "1", "a control step", MUSCLES, times)


def over_environments() -> Measured:
    """A step of few environments and of many, on one thread."""

    def step_of(count: int) -> Callable[[], object]:
        envs = gym.make_vec("Kengoro/Posture-v0", count, threads=1)
        assert isinstance(envs, KengoroVectorEnv)
        envs.reset(seed=0)
        actions = np.zeros((count, len(envs.muscles)), dtype=np.float32)
        return lambda: envs.step(actions)

    times = medians([step_of(count) for count in ENVIRONMENTS])
    return Measured("environments", "1", "a step of all", ENVIRONMENTS, times)


def diagnosis_time(seconds: float, count: int) -> float:
    """How long the diagnosis of a log takes on the CPU [s].

    Args:
        seconds: length of the log [s].
        count: causes it may come from; that which is hidden is always among them.
    """
    case = Case(HIDDEN.kind, HIDDEN.seed, seconds=seconds)
    names = sorted(CATALOGUE, key=lambda name: name != case.secret().effects[0].id)
    chosen = [CATALOGUE[names[i * len(names) // count]] for i in range(count)]
    with tempfile.TemporaryDirectory() as folder:
        write_case(Path(folder), case)
        study = load_study(Path(folder) / "STUDY.yaml")
        begin = process_time()
        diagnose(study, causes=chosen, options=Options(suggest=False))
        return process_time() - begin


def over_seconds() -> Measured:
    """A diagnosis of short logs and of long ones, with all causes."""
    shown = track(SECONDS, "lengths of logs", transient=True)
    times = [diagnosis_time(seconds, len(CATALOGUE)) for seconds in shown]
    return Measured("length of the log", "s", "a diagnosis", SECONDS, times)


def over_causes() -> Measured:
    """A diagnosis with few causes and with many, of a short log."""
    shown = track(CAUSES, "numbers of causes", transient=True)
    times = [diagnosis_time(SHORT, count) for count in shown]
    return Measured("causes", "1", "a diagnosis", CAUSES, times)


def draw(measured: Iterable[Measured], path: Path) -> None:
    """Write the panels, whole or not at all."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 2, figsize=(9, 6.4), layout="constrained")
    for axis, one in zip(axes.flat, measured, strict=True):
        law = PowerLaw.of(one.sizes, one.times)
        sizes = np.array(one.sizes)
        axis.loglog(sizes, law.factor * sizes**law.exponent, color="#999999", lw=1)
        axis.loglog(sizes, one.times, "o", color="#0072B2")
        axis.set_xticks(one.sizes, [f"{size:g}" for size in one.sizes])
        ends = [min(one.times), max(one.times)]
        axis.set_yticks(ends, [f"{end:.2g}" for end in ends])
        axis.minorticks_off()
        axis.set(
            title=f"exponent {law}",
            xlabel=f"{one.work} [{one.unit}]",
            ylabel=f"CPU time of {one.cost} [s]",
        )
        axis.grid(alpha=0.3)
    write_bytes(path, png(figure))
    pyplot.close(figure)


def main() -> None:
    """Measure, draw and print."""
    measured = [over_muscles(), over_environments(), over_seconds(), over_causes()]
    draw(measured, OUT)
    table = Table(title="How cost grows: CPU time ~ size^exponent, 95 % interval")
    for column in ("time of", "with", "sizes", "CPU s", "exponent"):
        table.add_column(column, justify="left")
    for one in measured:
        sizes = ", ".join(f"{size:g}" for size in one.sizes)
        times = ", ".join(f"{seconds:.3g}" for seconds in one.times)
        law = PowerLaw.of(one.sizes, one.times)
        table.add_row(one.cost, one.work, sizes, times, str(law))
    Console().print(table)
    print(f"Picture: {OUT}")


if __name__ == "__main__":
    main()
