"""Flexible residual: given columns, and a lever with a motor whose force is uneven."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, Values
from reality_gap.inference.flexible_residual import banks
from reality_gap.inference.learned_residual import Learned, learn, learn_best
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.motion_functions import Bank
from reality_gap.inference.problem import Problem
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.simulation.synthetic import simulate_study
from reality_gap.study.data import Episode, Reading, Study
from reality_gap.study.splits import REPORT, split
from reality_gap.study.system import System
from reality_gap.types import Floats

COUNT = 60
"""Number of columns of a bank."""


@pytest.fixture
def replayer(lever_study: Study) -> Replayer:
    """Return the replayer of the good study, of which only the times of readings matter."""
    return Replayer(lever_study)


@pytest.fixture
def bank(replayer: Replayer) -> Bank:
    """Return uncorrelated columns."""
    columns = np.random.default_rng(0).standard_normal((len(replayer.measured.value), COUNT))
    return Bank("by chance", columns / np.sqrt(np.mean(columns**2, axis=0)))


def noise(replayer: Replayer, seed: int) -> Floats:
    return np.random.default_rng(seed).standard_normal(len(replayer.measured.value))


def problem_of(replayer: Replayer, residual: Floats, tolerances: Floats | None = None) -> Problem:
    """Return a problem in which all readings count in full, by default without tolerances."""
    columns = np.zeros((len(residual), 0)) if tolerances is None else tolerances
    return Problem(replayer, residual, independent_noise(replayer.measured, columns))


def learned(replayer: Replayer, bank: Bank, residual: Floats) -> Learned:
    return learn(problem_of(replayer, residual), residual, bank)


@pytest.mark.parametrize("weight", [0.3, -2.0])
def test_the_right_column_is_learned(replayer: Replayer, bank: Bank, weight: float) -> None:
    truth = weight * bank.columns[:, 17]

    found = learned(replayer, bank, truth + noise(replayer, 1))

    # A regression on some 2000 readings errs by 1 / sqrt(2000) per column.
    np.testing.assert_allclose(found.prediction, truth, atol=0.2)
    assert found.evidence > 50.0
    # Of a power of weight^2 + 1, the column has weight^2.
    assert found.explained == pytest.approx(weight**2 / (weight**2 + 1), abs=0.05)


def test_columns_are_added_until_all_is_learned(replayer: Replayer, bank: Bank) -> None:
    weights = np.zeros(COUNT)
    weights[[3, 30, 45]] = 1.0, -0.6, 0.3
    truth = bank.columns @ weights

    found = learned(replayer, bank, truth + noise(replayer, 2))

    np.testing.assert_allclose(
        np.linalg.lstsq(bank.columns, found.prediction)[0], weights, atol=0.1
    )


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_not_learned(replayer: Replayer, bank: Bank, seed: int) -> None:
    found = learned(replayer, bank, noise(replayer, 10 + seed))

    assert found.evidence < 1.0
    np.testing.assert_array_equal(found.prediction, 0.0)
    assert found.explained == 0.0


def test_a_larger_bank_has_a_larger_penalty(replayer: Replayer, bank: Bank) -> None:
    """The selection of one of k columns has the penalty log k."""
    residual = 0.3 * bank.columns[:, 0] + noise(replayer, 3)
    two, many = (learned(replayer, Bank("", bank.columns[:, :k]), residual) for k in (2, COUNT))

    assert two.evidence - many.evidence == pytest.approx(np.log(COUNT / 2), abs=1e-6)


def test_the_best_of_many_banks_has_a_larger_penalty(replayer: Replayer, bank: Bank) -> None:
    """The selection of one of k banks has the penalty log k."""
    residual = 0.3 * bank.columns[:, 0] + noise(replayer, 3)
    others = [
        Bank("", np.column_stack([noise(replayer, 100 + 10 * i + j) for j in range(4)]))
        for i in range(9)
    ]

    alone = learned(replayer, bank, residual)
    of_ten = learn_best(problem_of(replayer, residual), residual, [*others, bank])

    assert of_ten.name == bank.name
    np.testing.assert_array_equal(of_ten.prediction, alone.prediction)
    assert alone.evidence - of_ten.evidence == pytest.approx(np.log(10), abs=1e-6)


@pytest.mark.parametrize("size", [0.02, 0.05])
def test_noise_has_evidence_by_chance_only(replayer: Replayer, size: float) -> None:
    """The best of 60 banks has odds above e^2 in at most one of e^2 cases: they are fair."""
    rng = np.random.default_rng(0)
    count = len(replayer.measured.value)
    found = []
    for _ in range(100):
        residual = rng.standard_normal(count)
        some = [Bank("", size * rng.standard_normal((count, 1))) for _ in range(60)]
        found.append(learn_best(problem_of(replayer, residual), residual, some).evidence)

    assert np.mean(np.array(found) > 2.0) <= np.exp(-2.0)


def test_the_report_split_is_not_learned_from(replayer: Replayer, bank: Bank) -> None:
    report = split(replayer.measured) == REPORT
    residual = bank.columns[:, 5] + noise(replayer, 4)
    spoilt = np.where(report, -residual, residual)

    good, bad = learned(replayer, bank, residual), learned(replayer, bank, spoilt)

    np.testing.assert_array_equal(good.prediction, bad.prediction)
    assert good.explained > 0.4
    assert bad.explained < -0.4


def test_the_effects_of_tolerances_are_not_learned(replayer: Replayer, bank: Bank) -> None:
    """A column within the tolerances of the nominal model is not learned."""
    column = bank.columns[:, 8]
    residual = 0.5 * column + noise(replayer, 5)

    found = learn(problem_of(replayer, residual, column[:, None]), residual, bank)

    assert found.evidence < 1.0
    assert learned(replayer, bank, residual).evidence > 50.0


@pytest.mark.parametrize("shape", [lambda t: np.ones_like(t), lambda t: 1.0 - np.exp(-t / 2.0)])
def test_an_error_that_is_constant_or_settles_is_learned(
    lever_study: Study, shape: Callable[[Floats], Floats]
) -> None:
    replayer = Replayer(lever_study)
    measured, records = replayer.measured, replayer.replay([]).records
    start = np.array([record.time[0] for record in records])[measured.episode]
    drift = np.where(measured.channel == 1, shape(measured.time + start), 0.0)
    residual = drift + noise(replayer, 6)

    problem = problem_of(replayer, residual)

    best = learn_best(problem, residual, banks(replayer, [], records))

    assert best.name == "readings by the time"
    error = float(np.mean((best.prediction - drift) ** 2))
    assert error < 0.1 * float(np.mean(drift**2))


def swinging(study: Study) -> Study:
    """Return three swings, with tendons that are never slack and without measurements.

    The physics has half the step of the study, for which the pitch of a motor is short.
    """
    finer = study.model.read_text(encoding="utf-8").replace('timestep="0.004"', 'timestep="0.002"')
    path = study.model.with_name("finer.xml")
    path.write_text(finer, encoding="utf-8")
    episode = study.episodes[0]
    time = np.arange(0.0, 5.1, 0.02)
    angle = 0.4 * np.sin(2 * np.pi * time / 1.7)
    command = np.column_stack([0.19 - 0.03 * angle, 0.19 + 0.03 * angle])
    readings = tuple(Reading(time, np.zeros(len(time))) for _ in study.channels)
    noise = {"m": 3e-4, "rad": 2e-3, "N": 0.1}
    channels = tuple(replace(c, noise=noise[c.unit]) for c in study.channels)
    swing: Episode = replace(episode, time=time, command=command, readings=readings)
    return replace(study, model=path, channels=channels, episodes=(swing,))


def uneven(force: float, pitch: float) -> tuple[Candidate, dict[str, float]]:
    """Return a motor whose force varies by ``force`` [N] once per ``pitch`` [m] of its tendon."""

    def attach(effects: Effects, system: System, location: Location, values: Values) -> None:
        gain = system.tendon("flexor").gain

        def make(model: mujoco.MjModel) -> Hook:
            actuator, tendon = model.actuator("flexor").id, model.tendon("flexor").id

            def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
                turn = 2 * np.pi * data.ten_length[tendon] / pitch
                data.ctrl[actuator] += values["force"] * np.sin(turn) / gain

            return hook

        effects.add_hook(make)

    cause = Cause("uneven", "", "", lambda s: (), lambda s, p: (), None, attach)
    parameter = Parameter("force", "N", 1.0, 0.0, -100.0, 100.0)
    return Candidate(cause, Location("tendon", ("flexor",)), (parameter,)), {"force": force}


@pytest.mark.usefixtures("frictionless")
def test_a_motor_that_is_uneven_is_found_at_its_tendon(lever_study: Study) -> None:
    study = swinging(lever_study)
    length = [r.sensors[:, r.column("length_flexor")] for r in Replayer(study).replay([]).records]
    truth = [uneven(1.0, pitch=float(np.ptp(length[0])) / 4)]
    replayer = Replayer(simulate_study(study, truth, np.random.default_rng(0)))
    residual = replayer.residual([])
    problem, records = problem_of(replayer, residual), replayer.replay([]).records

    tried = [learn(problem, residual, bank) for bank in banks(replayer, [], records)]

    found = {one.name: one for one in tried}
    best = max(tried, key=lambda one: one.evidence)
    assert best.name == "length of flexor, measured by its sensor"
    assert best.explained > 0.7
    for other in ("position of elbow", "length of flexor", "length of extensor"):
        assert found[other].explained < 0.5 * best.explained
