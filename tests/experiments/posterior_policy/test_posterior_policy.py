"""Policies from a diagnosis: models, refused samples, shares, and the whole run without PPO."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from experiments.__main__ import main
from experiments.learn_posture.policies import many_arms, one_arm
from experiments.posterior_policy import models
from experiments.posterior_policy.models import (
    CONDITIONS,
    DRAWING,
    EXTENDED,
    GUESSED,
    POSTERIOR,
    TRUE,
    guessed,
    refusal,
    samples,
    usable,
)
from experiments.posterior_policy.run import Args, Work, run
from experiments.posterior_policy.tables import metrics, policy_table
from experiments.posterior_policy.training import Linear, Sizes, acting, linear, rest_of
from experiments.robots.guessed_models import guessed_models
from kengoro.study_model import study_model
from kengoro_env.assets import asset_path
from kengoro_env.vector import KengoroVectorEnv
from mjcf_sandbox.files import write_json, write_text
from reality_gap.causes import find_cause
from reality_gap.posterior import Branch, Posterior
from reality_gap.report.posterior_file import MODEL, posterior_json
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.study.data import Episode, Initial, Study
from reality_gap.study.system import System, compile_system

TINY = Sizes(steps=10, environments=2, episodes=1, length=5)


@pytest.fixture(scope="module")
def nominal() -> mujoco.MjSpec:
    return study_model(asset_path("mjcf/kengoro_arm/posture.xml"))


@pytest.fixture(scope="module")
def system(nominal: mujoco.MjSpec, tmp_path_factory: pytest.TempPathFactory) -> System:
    path = tmp_path_factory.mktemp("model") / MODEL
    write_text(path, nominal.to_xml())
    log = Episode("", np.array([0.0, 1.0]), np.zeros((2, nominal.compile().nu)), ())
    study = Study("arm", path, (), (log,), Initial(settle=0.0))
    return compile_system(study)


def part(system: System, id: str, element: str, scales: float) -> Any:
    cause = find_cause(id)
    location = next(one for one in cause.locations(system) if one.elements == (element,))
    candidate = Candidate(cause, location, cause.parameters(system, location))
    return candidate, {p.name: p.null + scales * p.scale for p in candidate.parameters}


def posterior(system: System, *hypotheses: Hypothesis) -> Posterior:
    branches = [
        Branch(one, np.diag(np.full(sum(len(c.parameters) for c, _ in one), 0.01)), 0.5)
        for one in hypotheses
    ]
    return Posterior(system, [], tuple(branches))


def test_refused_samples_are_named_with_their_cause_and_replaced(system: System) -> None:
    heavier = part(system, "link_mass", "ulna", 3.0)
    gain = part(system, "length_scale", "biceps", 3.0)
    found = usable(posterior(system, [heavier], [heavier, gain]), 4, 0)
    assert len(found.specs) == 4
    assert found.refused
    for sentence in found.refused:
        assert sentence.startswith("the actuator 'biceps' of sample ")
        assert sentence.endswith("(by length_scale)")
    assert all(refusal(spec, "it") is None for spec in found.specs)
    assert len({spec.compile().body("ulna").mass[0] for spec in found.specs}) == 4


def test_samples_are_built_once_each_and_no_more_than_needed(
    system: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    built: list[object] = []
    extended = Posterior.extended
    monkeypatch.setattr(
        Posterior, "extended", lambda self, parts: (built.append(parts), extended(self, parts))[1]
    )
    found = usable(posterior(system, [part(system, "link_mass", "ulna", 3.0)]), 3, 0)
    assert len(found.specs) == len(built) == 3


def test_without_a_usable_sample_there_are_no_models(system: System, tmp_path: Path) -> None:
    gain = part(system, "length_scale", "biceps", 3.0)
    found = usable(posterior(system, [gain]), 1, 0)
    assert found.specs == []
    assert len(found.refused) == models.MOST
    unexplained = samples(tmp_path, 2, 0)
    assert unexplained.specs == []
    assert "unexplained" in unexplained.refused[0]


def test_guesses_are_within_a_fifth_and_fit(nominal: mujoco.MjSpec) -> None:
    before = nominal.compile()
    for spec in guessed(2, 1).specs:
        after = spec.compile()
        assert refusal(spec, "it") is None
        for name in ("body_mass", "dof_damping", "tendon_damping"):
            old, new = getattr(before, name), getattr(after, name)
            assert np.all(np.abs(new - old) <= 0.2 * np.abs(old) + 1e-12)
            assert np.any(new != old)
        np.testing.assert_allclose(after.actuator_gainprm[:, 0], -after.actuator_biasprm[:, 1])
        np.testing.assert_allclose(after.actuator_forcerange[:, 1], after.actuator_biasprm[:, 0])
        np.testing.assert_array_equal(after.actuator_forcerange[:, 0], -500.0)


def test_the_motor_of_the_fingers_is_not_guessed() -> None:
    nominal = study_model(asset_path("mjcf/kengoro_arm/can_grasp.xml"), fingers=True)
    (guess,) = guessed_models(nominal, 1, 1)
    old, new = nominal.compile(), guess.compile()
    fingers = new.actuator("fingers").id
    for name in ("actuator_gainprm", "actuator_biasprm", "actuator_forcerange"):
        before, after = getattr(old, name), getattr(new, name)
        np.testing.assert_array_equal(after[fingers], before[fingers])
        assert np.any(after[0] != before[0])
    assert new.body("can").mass[0] != old.body("can").mass[0]


def test_a_policy_scales_targets_by_the_joint_ranges() -> None:
    arms = many_arms(None, 1, 10)
    targets: Any = arms.single_observation_space["target"]  # type: ignore[index]
    count = len(targets.low)
    weights = np.zeros((36, count))
    weights[3, 2] = 0.5
    act = acting(linear(arms, np.zeros(36), weights, np.full(36, 0.1)))
    top = act({"target": targets.high[None].astype(float)})[0]
    assert top[3] == pytest.approx(0.3 * 0.6)
    assert top[4] == pytest.approx(0.3 * 0.1)
    assert act({"target": targets.low[None].astype(float)})[0, 3] == pytest.approx(0.3 * -0.4)


def rewards(**by_condition: list[float]) -> dict[str, dict[int, list[dict[str, float]]]]:
    return {
        condition: {
            robot: [{"reward": reward + d, "tension": 50.0, "success": 0.5} for d in (-0.1, 0.1)]
            for robot, reward in enumerate(by_condition[condition])
        }
        for condition in CONDITIONS
    }


def test_shares_are_of_what_separates_the_drawing_from_the_robot() -> None:
    found = metrics(
        rewards(
            drawing=[0.2, 0.5, 0.4], guessed=[0.2, 0.5, 0.4], extended=[0.6, 0.6, 0.9],
            posterior=[0.65, 0.7, 0.9], true=[0.7, 0.7, 0.4],
        )
    )  # fmt: skip
    assert found["(c) extended model: share"]["median"] == pytest.approx(0.65)  # 0.8 and 0.5
    assert found["(d) posterior: share"]["median"] == pytest.approx(0.95)
    assert found["(d) posterior: share"]["reached"]
    assert found["reward of (d) above (c)"]["reached"]
    assert found["reward of (e) above (a)"]["median"] == pytest.approx(0.2)


def test_shares_of_nothing_are_not_reached() -> None:
    same = rewards(**{condition: [0.4, 0.5] for condition in CONDITIONS})
    found = metrics(same)["(d) posterior: share"]
    assert (found["median"], found["must"], found["reached"]) == (None, 0.6, False)
    assert policy_table(same).rows[0][-1] == "-"


def test_the_whole_run_without_ppo_goes_on_where_it_ended(
    system: System, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    learned: list[int] = []

    def diagnosed(robot: int, sizes: Sizes, folder: Path) -> dict[str, Any]:
        write_text(folder / "extended.xml", system.study.spec().to_xml())
        write_json(folder / "extended.json", {"model": "extended.xml", "effects": []})
        write_text(folder / MODEL, system.study.spec().to_xml())
        parts = [part(system, "length_scale" if robot else "link_mass", element, 3.0)
                 for element in ("biceps" if robot else "ulna",)]  # fmt: skip
        write_json(folder / "posterior.json", posterior_json(posterior(system, parts)))
        write_json(folder / "verdict.json", {})
        return {"verdict": "named"}

    def learn(arms: KengoroVectorEnv, seed: int, sizes: Sizes) -> Linear:
        learned.append(seed)
        count = len(arms.joints)
        return linear(arms, rest_of(arms), np.zeros((36, count)), np.zeros(36))

    args, work = Args(out=tmp_path, seeds="5"), Work(diagnosed, learn)
    summary = run(args, [0, 1], [5], TINY, "none", work)
    assert len(learned) == 7  # (a), (b), and (c), (d), (e) of two robots, without one (d)
    assert set(summary["per_seed"]["0"]) == set(CONDITIONS)
    assert summary["per_seed"]["1"][POSTERIOR] == summary["per_seed"]["1"][GUESSED]
    assert summary["per_seed"]["0"][TRUE] != summary["per_seed"]["1"][TRUE]
    assert summary["per_seed"]["0"][DRAWING] != summary["per_seed"]["0"][TRUE]
    assert any("(by length_scale)" in message for message in summary["messages"])
    assert not any(EXTENDED in message for message in summary["messages"])
    shown = capsys.readouterr().out
    assert "posterior, robot 1, seed 5: not trained" in shown
    assert "guessed randomisation is judged instead" in shown
    assert json.loads((tmp_path / "summary.json").read_text())["training_seeds"] == "5"
    again = run(args, [0, 1], [5], TINY, "none", work)
    assert len(learned) == 7
    assert again["per_seed"] == summary["per_seed"]


def test_the_rest_is_that_of_the_environments() -> None:
    nominal, actual = (rest_of(many_arms(robot, 2, 10)) for robot in (None, 3))
    assert nominal.shape == actual.shape == one_arm(None).action_space.shape
    assert np.any(nominal != actual)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--robots", "x"], "Seeds are 'x'; give one such as 3 or a range such as 0-9.\n"),
        (["--steps", "0"], "Steps are 0, but at least 1 is needed.\n"),
        (["--jobs", "0"], "Jobs are 0, but at least 1 is needed.\n"),
    ],
)
def test_bad_input_is_one_sentence(
    options: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["posterior-policy", "--out", str(tmp_path / "new"), *options]) == 2
    assert capsys.readouterr().err == sentence
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
@pytest.mark.torch
def test_the_small_version_runs_and_goes_on(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    command = ["posterior-policy", "--quick", "--robots", "0", "--seeds", "0"]
    assert main([*command, "--out", str(tmp_path)]) == 0
    first = json.loads((tmp_path / "summary.json").read_text())
    assert main([*command, "--out", str(tmp_path)]) == 0
    again = json.loads((tmp_path / "summary.json").read_text())
    assert again["metrics"] == first["metrics"]
    assert again["wall_s"] < first["wall_s"]
