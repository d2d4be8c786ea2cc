"""Growth of CPU time with the number of muscles, environments and causes, and the length of a log.

The figure ``out/growth.png`` has four panels, each with the exponent of a fitted power law and its
95 % interval:

* muscles: control step of one robot, of which muscles are removed or copied; without gravity, so
  that no joint falls to its stop.
* environments: step of `make_vec` on one thread.
* length of the log, causes: diagnosis of the elbow with one hidden effect, on one core, without the
  proposal of the next experiment.

CPU times depend less on other programs than wall-clock times.
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
"""Rounds, and calls of a round, of the control steps and environment steps."""

HIDDEN = Case("single", 32)
"""Hidden effect of the diagnoses: lag of a motor of the elbow."""

SECONDS = (2.5, 5.0, 10.0, 20.0)
"""Lengths of the diagnosed logs [s]."""

CAUSES = (3, 7, 14, 28)
"""Numbers of causes of the diagnoses."""

SHORT = 2.5
"""Length of the log of the diagnoses with `CAUSES` [s]."""


class Measurement(NamedTuple):
    """CPU times of a task at several sizes.

    Attributes:
        quantity, unit: what grows, and its unit.
        task: task that is timed.
        sizes: values of the quantity, shape (k,).
        times: CPU times, shape (k,) [s].
    """

    quantity: str
    unit: str
    task: str
    sizes: Sequence[float]
    times: Sequence[float]


class PowerLaw(NamedTuple):
    """Power law: time = factor size^exponent; ``low`` and ``high`` bound the exponent (95 %)."""

    factor: float
    exponent: float
    low: float
    high: float

    @classmethod
    def fit(cls, sizes: Sequence[float], times: Sequence[float]) -> PowerLaw:
        """Fit the logarithms by least squares.

        Args:
            sizes: shape (k,), k >= 3.
            times: shape (k,) [s].
        """
        line = linregress(np.log(sizes), np.log(times))
        half = float(t.ppf(0.975, len(sizes) - 2) * line.stderr)
        slope = float(line.slope)
        return cls(float(np.exp(line.intercept)), slope, slope - half, slope + half)

    def __str__(self) -> str:
        return f"{self.exponent:.2f} [{self.low:.2f}, {self.high:.2f}]"


@dataclass(frozen=True)
class Muscles:
    """Departure: robot with ``count`` muscles, some nominal ones or all of them and copies."""

    count: int

    def edit(self, draft: Draft) -> None:
        """Apply the departure to a draft."""
        spec, nominal = draft.spec, list(draft.tendons)
        spec.option.gravity = np.zeros(3)
        kept = {nominal[i * len(nominal) // self.count] for i in range(self.count)}
        for name in set(nominal) - kept:
            spec.delete(spec.tendon(name))
            del draft.tendons[name]
        for number in range(len(nominal), self.count):
            original = spec.tendon(nominal[number % len(nominal)])
            copy = spec.add_tendon(original.default(), name=f"{original.name}_{number}")
            for element in original.path:
                copy.wrap_site(element.target.name)
            draft.tendons[copy.name] = TendonSpec()


def medians(works: Sequence[Callable[[], object]]) -> list[float]:
    """Median CPU time of each work [s]; the works alternate."""
    times = np.empty((ROUNDS, len(works)))
    for round_ in range(ROUNDS):
        for number, work in enumerate(works):
            begin = process_time()
            for _ in range(STEPS):
                work()
            times[round_, number] = (process_time() - begin) / STEPS
    return [float(seconds) for seconds in np.median(times, axis=0)]


def over_muscles() -> Measurement:
    """Measure a control step with its sensor readings at each number of muscles."""

    def step_of(robot: Robot) -> Callable[[], object]:
        held = robot.target

        def work() -> None:
            robot.step(held)
            robot.measured_lengths()
            robot.measured_tensions()

        return work

    robots = [Robot(asset_path(SCENE), [Muscles(count)]) for count in MUSCLES]
    times = medians([step_of(robot) for robot in robots])
    return Measurement("muscles", "1", "a control step", MUSCLES, times)


def over_environments() -> Measurement:
    """Measure a step of all environments on one thread, at each number of environments."""

    def step_of(count: int) -> Callable[[], object]:
        envs = gym.make_vec("Kengoro/Posture-v0", count, threads=1)
        assert isinstance(envs, KengoroVectorEnv)
        envs.reset(seed=0)
        actions = np.zeros((count, len(envs.muscles)), dtype=np.float32)
        return lambda: envs.step(actions)

    times = medians([step_of(count) for count in ENVIRONMENTS])
    return Measurement("environments", "1", "a step of all", ENVIRONMENTS, times)


def diagnosis_time(seconds: float, count: int) -> float:
    """CPU time of the diagnosis of a log [s].

    Args:
        seconds: length of the log [s].
        count: number of causes; that of the hidden effect is always among them.
    """
    case = Case(HIDDEN.kind, HIDDEN.seed, seconds=seconds)
    names = sorted(CATALOGUE, key=lambda name: name != case.secret().effects[0].id)
    causes = [CATALOGUE[names[i * len(names) // count]] for i in range(count)]
    with tempfile.TemporaryDirectory() as folder:
        write_case(Path(folder), case)
        study = load_study(Path(folder) / "STUDY.yaml")
        begin = process_time()
        diagnose(study, causes=causes, options=Options(suggest=False))
        return process_time() - begin


def over_seconds() -> Measurement:
    """Measure a diagnosis with all causes at each length of the log."""
    lengths = track(SECONDS, "lengths of logs", transient=True)
    times = [diagnosis_time(seconds, len(CATALOGUE)) for seconds in lengths]
    return Measurement("length of the log", "s", "a diagnosis", SECONDS, times)


def over_causes() -> Measurement:
    """Measure a diagnosis of a short log at each number of causes."""
    counts = track(CAUSES, "numbers of causes", transient=True)
    times = [diagnosis_time(SHORT, count) for count in counts]
    return Measurement("causes", "1", "a diagnosis", CAUSES, times)


def draw(measurements: Iterable[Measurement], path: Path) -> None:
    """Draw the panels.

    Args:
        measurements: four, one for each panel.
        path: PNG file, which is written whole or not at all; its folder is made.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 2, figsize=(9, 6.4), layout="constrained")
    for axis, one in zip(axes.flat, measurements, strict=True):
        law = PowerLaw.fit(one.sizes, one.times)
        sizes = np.array(one.sizes)
        axis.loglog(sizes, law.factor * sizes**law.exponent, color="#999999", lw=1)
        axis.loglog(sizes, one.times, "o", color="#0072B2")
        axis.set_xticks(one.sizes, [f"{size:g}" for size in one.sizes])
        ends = [min(one.times), max(one.times)]
        axis.set_yticks(ends, [f"{end:.2g}" for end in ends])
        axis.minorticks_off()
        axis.set(
            title=f"exponent {law}",
            xlabel=f"{one.quantity} [{one.unit}]",
            ylabel=f"CPU time of {one.task} [s]",
        )
        axis.grid(alpha=0.3)
    write_bytes(path, png(figure))
    pyplot.close(figure)


def main() -> None:
    """Measure, draw the figure and print the table."""
    measurements = [over_muscles(), over_environments(), over_seconds(), over_causes()]
    draw(measurements, OUT)
    table = Table(title="CPU time ~ size^exponent, with the 95 % interval of the exponent")
    for column in ("task", "quantity", "sizes", "CPU time [s]", "exponent"):
        table.add_column(column, justify="left")
    for one in measurements:
        sizes = ", ".join(f"{size:g}" for size in one.sizes)
        times = ", ".join(f"{seconds:.3g}" for seconds in one.times)
        law = PowerLaw.fit(one.sizes, one.times)
        table.add_row(one.task, one.quantity, sizes, times, str(law))
    Console().print(table)
    print(f"Figure: {OUT}")


if __name__ == "__main__":
    main()
