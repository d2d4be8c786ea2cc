"""The flexible residual: columns by hand, and a lever one of whose motors is uneven."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, Values
from reality_gap.inference.flexible_residual import Bank, Learned, banks, learn
from reality_gap.inference.likelihood import NoiseModel, noise_model
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.simulation.synthetic import simulate
from reality_gap.study.data import Episode, Reading, Study
from reality_gap.study.splits import REPORT, split
from reality_gap.study.system import System
from reality_gap.types import Floats

COUNT = 60
"""Columns of a bank."""


@pytest.fixture
def replayer(lever_study: Study) -> Replayer:
    """Of the good study; here only the times of its readings matter."""
    return Replayer(lever_study)


@pytest.fixture
def bank(replayer: Replayer) -> Bank:
    """Columns that have nothing to do with each other."""
    columns = np.random.default_rng(0).standard_normal((len(replayer.measured.value), COUNT))
    return Bank("by chance", columns / np.sqrt(np.mean(columns**2, axis=0)))


def noise(replayer: Replayer, seed: int) -> Floats:
    return np.random.default_rng(seed).standard_normal(len(replayer.measured.value))


def plain(replayer: Replayer, residual: Floats) -> NoiseModel:
    """Without tolerances: every reading counts in full."""
    return noise_model(replayer.measured, residual, np.zeros((len(residual), 0)))


def learned(replayer: Replayer, bank: Bank, residual: Floats) -> Learned:
    return learn(replayer, plain(replayer, residual), residual, bank)


@pytest.mark.parametrize("weight", [0.3, -2.0])
def test_the_one_column_that_is_there_is_found(
    replayer: Replayer, bank: Bank, weight: float
) -> None:
    truth = weight * bank.columns[:, 17]

    found = learned(replayer, bank, truth + noise(replayer, 1))

    # A regression on some 2000 readings errs by 1 / sqrt(2000) per column.
    np.testing.assert_allclose(found.prediction, truth, atol=0.2)
    assert found.evidence > 50.0
    # Of a power of weight^2 + 1, the column has weight^2.
    assert found.explained == pytest.approx(weight**2 / (weight**2 + 1), abs=0.05)


def test_columns_come_in_until_all_is_learned(replayer: Replayer, bank: Bank) -> None:
    weights = np.zeros(COUNT)
    weights[[3, 30, 45]] = 1.0, -0.6, 0.3
    truth = bank.columns @ weights

    found = learned(replayer, bank, truth + noise(replayer, 2))

    np.testing.assert_allclose(
        np.linalg.lstsq(bank.columns, found.prediction)[0], weights, atol=0.1
    )


@pytest.mark.parametrize("seed", range(5))
def test_of_noise_nothing_is_learned(replayer: Replayer, bank: Bank, seed: int) -> None:
    found = learned(replayer, bank, noise(replayer, 10 + seed))

    assert found.evidence < 1.0
    np.testing.assert_array_equal(found.prediction, 0.0)
    assert found.explained == 0.0


def test_a_bank_with_more_to_choose_from_pays_more(replayer: Replayer, bank: Bank) -> None:
    """One of k columns is chosen at the price of log k; all that is beside it is the same."""
    residual = 0.3 * bank.columns[:, 0] + noise(replayer, 3)
    two, many = (learned(replayer, Bank("", bank.columns[:, :k]), residual) for k in (2, COUNT))

    assert two.evidence - many.evidence == pytest.approx(np.log(COUNT / 2), abs=1e-6)


def test_what_is_reported_takes_no_part_in_the_learning(replayer: Replayer, bank: Bank) -> None:
    report = split(replayer.measured) == REPORT
    residual = bank.columns[:, 5] + noise(replayer, 4)
    spoilt = np.where(report, -residual, residual)

    good, bad = learned(replayer, bank, residual), learned(replayer, bank, spoilt)

    np.testing.assert_array_equal(good.prediction, bad.prediction)
    assert good.explained > 0.4
    assert bad.explained < -0.4


def test_what_tolerances_explain_is_not_learned(replayer: Replayer, bank: Bank) -> None:
    """A column that every honest drawing may be off by is no news."""
    column = bank.columns[:, 8]
    residual = 0.5 * column + noise(replayer, 5)
    tolerant = noise_model(replayer.measured, residual, column[:, None])

    found = learn(replayer, tolerant, residual, bank)

    assert found.evidence < 1.0
    assert learned(replayer, bank, residual).evidence > 50.0


def swinging(study: Study) -> Study:
    """Three swings with wires so tight that none is ever slack; not measured yet."""
    episode = study.episodes[0]
    time = np.arange(0.0, 5.1, 0.02)
    angle = 0.4 * np.sin(2 * np.pi * time / 1.7)
    command = np.column_stack([0.19 - 0.03 * angle, 0.19 + 0.03 * angle])
    readings = tuple(Reading(time, np.zeros(len(time))) for _ in study.channels)
    noise = {"m": 3e-4, "rad": 2e-3, "N": 0.1}
    channels = tuple(replace(c, noise=noise[c.unit]) for c in study.channels)
    swing: Episode = replace(episode, time=time, command=command, readings=readings)
    return replace(study, channels=channels, episodes=(swing,))


def uneven(force: float, pitch: float) -> tuple[Candidate, dict[str, float]]:
    """A motor that pulls more and less, ``force`` [N], once per ``pitch`` [m] of its wire."""

    def attach(effects: Effects, system: System, location: Location, values: Values) -> None:
        gain = system.tendon("flexor").gain

        def make(model: mujoco.MjModel) -> Hook:
            actuator, tendon = model.actuator("flexor").id, model.tendon("flexor").id

            def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
                turn = 2 * np.pi * data.ten_length[tendon] / pitch
                data.ctrl[actuator] += values["force"] * np.sin(turn) / gain

            return hook

        effects.act(make)

    cause = Cause("uneven", "", "", lambda s: (), lambda s, p: (), None, attach)
    parameter = Parameter("force", "N", 1.0, 0.0, -100.0, 100.0)
    return Candidate(cause, Location("tendon", ("flexor",)), (parameter,)), {"force": force}


@pytest.mark.usefixtures("frictionless")
def test_a_motor_that_is_uneven_is_found_at_its_wire(lever_study: Study) -> None:
    study = swinging(lever_study)
    length = [r.sensors[:, r.column("length_flexor")] for r in Replayer(study).look([]).records]
    truth = [uneven(1.0, pitch=float(np.ptp(length[0])) / 4)]
    replayer = Replayer(simulate(study, truth, np.random.default_rng(0)))
    residual = replayer.residual([])
    rule = plain(replayer, residual)

    tried = [
        learn(replayer, rule, residual, b) for b in banks(replayer, [], replayer.look([]).records)
    ]

    found = {one.name: one for one in tried}
    best = max(tried, key=lambda one: one.evidence)
    assert best.name == "length of flexor, felt by its sensor"
    assert best.explained > 0.7
    for other in ("position of elbow", "length of flexor", "length of extensor"):
        assert found[other].explained < 0.5 * best.explained
