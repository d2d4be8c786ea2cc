"""Posterior: samples have its mean, covariance and weights, within bounds, and are models."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.stats import truncnorm

from reality_gap import posterior as module
from reality_gap.__main__ import main
from reality_gap.causes import CATALOGUE, find_cause
from reality_gap.causes.support.typical_scales import joint_uses
from reality_gap.diagnosis import Diagnosis, Verdict
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.inference.equivalence import Alternatives
from reality_gap.inference.gauss_newton import Fit
from reality_gap.inference.intervals import intervals
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.posteriors import (
    covariance_by_noise,
    joint_covariance,
    search_branches,
    tolerance_branch,
)
from reality_gap.inference.theta import GOOD, theta_bounds, to_theta, with_theta
from reality_gap.inference.tolerances import Tolerance
from reality_gap.posterior import Branch, Posterior, TruncatedGaussian
from reality_gap.report.extended_model import load_extended
from reality_gap.report.files import write_diagnosis
from reality_gap.report.posterior_file import (
    JSON,
    MODEL,
    load_posterior,
    nominal_xml,
    write_posterior,
)
from reality_gap.simulation.hypothesis import Candidate, Part
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.measurements import BLOCK, Measured
from reality_gap.study.splits import blocks
from reality_gap.study.system import System, compile_system

Make = Callable[[Verdict], Diagnosis]
MANY, DRAWS = 2000, 400


def candidate(system: System, id: str, element: str) -> Candidate:
    cause = find_cause(id)
    location = next(p for p in cause.locations(system) if p.elements == (element,))
    return Candidate(cause, location, cause.parameters(system, location))


def damping(model: mujoco.MjModel) -> float:
    """Viscous friction of the flexor [N s/m]."""
    return float(model.tendon_damping[model.tendon("flexor").id].flat[0])


@pytest.fixture
def system(lever_study: Study) -> System:
    return compile_system(lever_study)


@pytest.fixture
def parts(system: System) -> list[Part]:
    """Friction of the flexor and an offset of the extensor's encoder, both large."""
    friction = candidate(system, "viscous_friction", "flexor")
    offset = candidate(system, "length_offset", "extensor")
    values = [
        {p.name: p.null + 5.0 * p.scale for p in one.parameters} for one in (friction, offset)
    ]
    return list(zip((friction, offset), values, strict=True))


def thetas(posterior: Posterior, n: int, seed: int = 0) -> np.ndarray:
    return np.array([to_theta(parts) for parts in posterior.hypotheses(n, seed)])


def test_samples_have_the_mean_and_the_covariance_of_the_posterior(
    system: System, parts: list[Part]
) -> None:
    covariance = np.array([[0.25, 0.3], [0.3, 0.64]])
    found = thetas(Posterior(system, [], (Branch(parts, covariance),)), MANY)

    error = np.sqrt(np.diag(covariance) / MANY)
    assert np.all(np.abs(found.mean(axis=0) - [5.0, 5.0]) < 4.0 * error)
    np.testing.assert_allclose(np.cov(found.T), covariance, rtol=0.12)


@pytest.mark.parametrize("tries", [module.TRIES, 0])
def test_a_gaussian_that_bounds_cut_has_the_moments_of_the_cut_one(
    tries: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where all parameters are at their bounds, where no sample of the whole is within."""
    monkeypatch.setattr(module, "TRIES", tries)
    low, high = np.array([0.0, -0.5, 2.0]), np.array([np.inf, 0.5, 3.0])
    gaussian = TruncatedGaussian(np.zeros(3), np.diag([1.0, 4.0, 1.0]), low, high)
    random = np.random.default_rng(1)

    found = np.array([gaussian.draw(random) for _ in range(DRAWS)])

    size = np.array([1.0, 2.0, 1.0])
    exact = [truncnorm(a / s, b / s, scale=s) for a, b, s in zip(low, high, size, strict=True)]
    spread = np.array([one.std() for one in exact])
    mean = np.array([one.mean() for one in exact])
    assert np.all(np.abs(found.mean(axis=0) - mean) < 4.0 * spread / np.sqrt(DRAWS))
    np.testing.assert_allclose(found.std(axis=0), spread, rtol=0.15)
    assert np.all((found >= low) & (found <= high))


def test_both_kinds_of_draws_agree_on_correlated_parameters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    covariance = np.array([[1.0, 0.8], [0.8, 1.0]])
    gaussian = TruncatedGaussian(np.zeros(2), covariance, np.zeros(2), np.full(2, np.inf))
    moments = []
    for tries in (module.TRIES, 0):
        monkeypatch.setattr(module, "TRIES", tries)
        random = np.random.default_rng(2)
        found = np.array([gaussian.draw(random) for _ in range(DRAWS)])
        moments.append((found.mean(axis=0), np.cov(found.T)))

    np.testing.assert_allclose(moments[0][0], moments[1][0], atol=0.15)
    np.testing.assert_allclose(moments[0][1], moments[1][1], atol=0.15)


def test_an_interval_far_from_the_mean_is_sampled_at_its_near_end() -> None:
    ends = np.array([60.0]), np.array([61.0])
    far = TruncatedGaussian(np.zeros(1), np.eye(1), *ends)
    near = [far.draw(np.random.default_rng(seed))[0] for seed in range(20)]

    assert all(60.0 <= one < 60.5 for one in near)


def test_samples_are_within_the_bounds_of_the_parameters(system: System) -> None:
    """Friction that is estimated as 0 is never negative."""
    friction = candidate(system, "viscous_friction", "flexor")
    size = sum(1 for _ in friction.parameters)
    posterior = Posterior(system, [], (Branch([(friction, friction.null_values())], np.eye(size)),))

    found = thetas(posterior, 500)

    low, high = theta_bounds(friction.parameters)
    assert low.min() == 0.0
    assert np.all((found >= low) & (found <= high))
    assert found.std() > 0.1


def test_equivalent_causes_are_sampled_by_their_weights(system: System, parts: list[Part]) -> None:
    branches = tuple(
        Branch([part], 0.01 * np.eye(1), w) for part, w in zip(parts, (0.7, 0.3), strict=True)
    )
    posterior = Posterior(system, [], branches)

    names = [found[0][0].cause.id for found in posterior.hypotheses(MANY)]

    share = names.count("viscous_friction") / MANY
    assert set(names) == {"viscous_friction", "length_offset"}
    assert abs(share - 0.7) < 4.0 * np.sqrt(0.7 * 0.3 / MANY)


def linear_fit(parts: list[Part], jacobian: np.ndarray) -> Fit:
    return Fit(parts, np.zeros(len(jacobian)), jacobian, to_theta(parts), 10.0)


def problem_of(count: int, in_block: int = 2) -> Any:
    """A problem whose readings have independent noise, some in each block of the log."""
    none = np.zeros(count, dtype=np.int64)
    time = BLOCK * (np.arange(count) + 0.5) / in_block
    measured = Measured(
        np.zeros(count), np.ones(count), none, none, time, np.zeros((0, 4), dtype=np.int64)
    )
    noise_model = independent_noise(measured, np.zeros((count, 0)))
    return SimpleNamespace(noise_model=noise_model, measured=measured)


def alternatives(own: Fit, others: list[tuple[Fit, float]], index: int) -> Alternatives:
    chances = [1.0 - sum(chance for _, chance in others), *(chance for _, chance in others)]
    replaced = own.candidates[index]
    return Alternatives(
        candidate=replaced,
        without=own,
        tried=(own, *(fitted for fitted, _ in others)),
        confidence=0.9 * np.array(chances),
        evidence=np.zeros(1 + len(others)),
        own=10.0,
        alike=(True, *(chance > 0.05 for _, chance in others)),
        equivalent=tuple(fitted.candidates[-1] for fitted, chance in others if chance > 0.05),
    )


def test_branches_are_the_causes_and_their_equivalents(system: System, parts: list[Part]) -> None:
    """Two causes with an equivalent each, and one that the data exclude."""
    slopes = np.random.default_rng(0).standard_normal((50, 2))
    best = linear_fit(parts, slopes)
    scale = candidate(system, "length_scale", "extensor")
    scaled = (scale, {p.name: p.null + p.scale for p in scale.parameters})
    other = candidate(system, "viscous_friction", "extensor")
    moved = (other, {p.name: p.null + p.scale for p in other.parameters})
    first = linear_fit([parts[1], moved], slopes[:, ::-1])
    second = linear_fit([parts[0], scaled], slopes)
    unlikely = linear_fit([parts[0], moved], slopes)
    found = [
        alternatives(best, [(first, 0.4)], 0),
        alternatives(best, [(second, 0.25), (unlikely, 0.02)], 1),
    ]

    problem = problem_of(50)
    used = slopes[problem.noise_model.whiten.use]

    branches = search_branches(problem, best, found)

    weights = {
        tuple(c.cause.id + " " + c.location.elements[0] for c, _ in b.hypothesis): b.weight
        for b in branches
    }
    total = 0.73 + 0.25
    assert weights == pytest.approx(
        {
            ("viscous_friction flexor", "length_offset extensor"): 0.6 * 0.73 / total,
            ("length_offset extensor", "viscous_friction extensor"): 0.4 * 0.73 / total,
            ("viscous_friction flexor", "length_scale extensor"): 0.6 * 0.25 / total,
            ("viscous_friction extensor", "length_scale extensor"): 0.4 * 0.25 / total,
        }
    )
    for branch in branches:
        assert branch.covariance.shape == (2, 2)
        np.testing.assert_allclose(
            np.sort(np.linalg.eigvalsh(branch.covariance)),
            np.sort(np.linalg.eigvalsh(np.linalg.inv(used.T @ used))),
            rtol=0.05,
        )


def test_the_covariance_is_that_of_the_linear_fit(parts: list[Part]) -> None:
    """Readings y = J theta + noise, fitted again and again, spread like the samples."""
    random = np.random.default_rng(3)
    slopes = random.standard_normal((40, 2)) * [3.0, 1.0] + [[0.0, 0.5]]
    problem = problem_of(40)
    covariance = joint_covariance(problem, linear_fit(parts, slopes))

    used = slopes[problem.noise_model.whiten.use]
    noise = random.standard_normal((len(used), 5000))
    spread = np.cov(np.linalg.lstsq(used, noise, rcond=None)[0])

    np.testing.assert_allclose(covariance, spread, rtol=0.1, atol=2e-4)


@pytest.mark.parametrize(("wrong", "factor"), [(0.0, 1.0), (2.0, 9.0)])
def test_the_covariance_is_as_large_as_blocks_of_the_log_differ(
    parts: list[Part], wrong: float, factor: float
) -> None:
    """In each block, a wrong form pulls the first parameter another way."""
    random, problem = np.random.default_rng(4), problem_of(800, 10)
    use, block = problem.noise_model.whiten.use, blocks(problem.measured)
    slopes = 0.3 * random.standard_normal((800, 2))
    estimates, variances = [], []
    for _ in range(200):
        error = wrong * random.standard_normal(block.max() + 1)[block] * slopes[:, 0]
        readings = random.standard_normal(800) + error
        theta = np.linalg.lstsq(slopes[use], readings[use], rcond=None)[0]
        fitted = replace(linear_fit(parts, slopes), residual=readings - slopes @ theta)
        estimates.append(theta)
        variances.append(np.diag(joint_covariance(problem, fitted)))

    spread, expected = np.var(estimates, axis=0), np.mean(variances, axis=0)
    by_noise = np.diag(covariance_by_noise(problem, fitted))
    assert spread[0] > 0.5 * factor * by_noise[0]
    assert 0.8 * spread[0] < expected[0] < 1.5 * spread[0]
    assert np.all(expected >= by_noise)


@pytest.mark.parametrize("wrong", [0.0, 2.0])
def test_intervals_are_as_wide_as_blocks_of_the_log_differ(parts: list[Part], wrong: float) -> None:
    random, problem = np.random.default_rng(5), problem_of(800, 10)
    slopes = 3.0 * random.standard_normal((800, 2))
    block = blocks(problem.measured)
    error = wrong * random.standard_normal(block.max() + 1)[block] * slopes[:, 0]
    readings = random.standard_normal(800) + error + slopes @ to_theta(parts)
    use = problem.noise_model.whiten.use
    theta = np.linalg.lstsq(slopes[use], readings[use], rcond=None)[0]

    def residuals(hypotheses: list[list[Part]]) -> list[np.ndarray]:
        return [readings - slopes @ to_theta(one) for one in hypotheses]

    problem.replayer = SimpleNamespace(residuals=residuals)
    best = linear_fit(with_theta(parts, theta), slopes)
    best = replace(best, residual=readings - slopes @ theta)

    found = [one for each in intervals(problem, best) for one in each.values()]

    scale = [abs(candidate.parameters[0].scale) for candidate, _ in parts]
    wide = np.sqrt(np.diag(joint_covariance(problem, best))) * scale
    for one, deviation in zip(found, wide, strict=True):
        assert one.low < one.value < one.high
        assert 0.5 * (one.high - one.low) == pytest.approx(1.96 * deviation, rel=0.05)


@pytest.fixture
def tolerances(system: System) -> list[Tolerance]:
    """A tolerance of each parameter that has one, at each single element."""
    found = []
    for cause in CATALOGUE.values():
        for location in cause.locations(system):
            if len(location.elements) > 1:
                continue
            one = Candidate(cause, location, cause.parameters(system, location))
            found += [
                Tolerance(one, p, float(np.copysign(p.tolerance, p.scale)), np.zeros(1))
                for p in one.parameters
                if p.tolerance > 0.0
            ]
    return found


def test_a_model_without_fault_deviates_within_its_tolerances(
    system: System, tolerances: list[Tolerance]
) -> None:
    posterior = Posterior(system, [], (tolerance_branch(tolerances),))
    limits = {(t.candidate.cause.id, t.candidate.location, t.parameter.name): t for t in tolerances}
    assert len(limits) == len(tolerances) > 20
    shares: dict[Any, list[float]] = {key: [] for key in limits}

    for found in posterior.hypotheses(60):
        for one, values in found:
            for p in one.parameters:
                known = limits.get((one.cause.id, one.location, p.name))
                if known is None:
                    assert values[p.name] == p.null
                    continue
                share = (values[p.name] - p.null) / known.parameter.tolerance
                shares[one.cause.id, one.location, p.name].append(share)

    for key, some in shares.items():
        p = limits[key].parameter
        assert p.low <= p.null <= p.high
        assert np.abs(some).max() <= GOOD * (1 + 1e-9), key
        two_sided = p.low <= p.null - p.tolerance and p.high >= p.null + p.tolerance
        assert np.sqrt(np.mean(np.square(some))) == pytest.approx(0.88, abs=0.4), key
        if two_sided:
            assert abs(np.mean(some)) < 0.4, key


def test_a_model_within_its_tolerances_can_be_simulated(
    system: System, tolerances: list[Tolerance]
) -> None:
    for sample in Posterior(system, [], (tolerance_branch(tolerances),)).sample(3):
        model = sample.spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 100)
        assert np.all(np.isfinite(data.qpos))


@pytest.fixture
def posterior(system: System, parts: list[Part]) -> Posterior:
    return Posterior(system, [], (Branch(parts, np.array([[0.25, 0.1], [0.1, 0.64]])),))


def test_a_sample_is_a_model_with_the_values_and_effects_beside_it(
    posterior: Posterior, system: System
) -> None:
    nominal = damping(system.model)
    for (first, offset), sample in zip(posterior.hypotheses(5), posterior.sample(5), strict=True):
        model = mujoco.MjModel.from_xml_string(sample.spec.to_xml())
        (added,) = first[1].values()
        assert damping(model) - nominal == pytest.approx(added, rel=1e-4)
        assert [(e.cause.id, e.values) for e in sample.effects] == [("length_offset", offset[1])]


def test_samples_are_deterministic_and_a_longer_list_begins_with_a_shorter_one(
    posterior: Posterior,
) -> None:
    eight, four = thetas(posterior, 8, 5), thetas(posterior, 4, 5)
    np.testing.assert_array_equal(eight, thetas(posterior, 8, 5))
    np.testing.assert_array_equal(eight[:4], four)
    assert not np.any(eight == thetas(posterior, 8, 6))
    assert len({tuple(one) for one in eight}) == 8


@pytest.mark.parametrize(
    ("n", "seed"), [(0, 0), (1.5, 0), (True, 0), (10**9, 0), (1, -1), (1, "a")]
)
def test_numbers_out_of_range_are_refused(posterior: Posterior, n: Any, seed: Any) -> None:
    with pytest.raises(StudyError, match="must be a whole number"):
        posterior.sample(n, seed)


def test_an_unexplained_gap_has_no_samples(diagnosed: Make) -> None:
    with pytest.raises(StudyError, match="the gap is unexplained"):
        diagnosed(Verdict.UNEXPLAINED).sample(3)


@pytest.fixture
def folder(
    diagnosed: Make,
    posterior: Posterior,
    lever_study: Study,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Path:
    """Folder of a diagnosis with a posterior, without its report."""
    monkeypatch.setattr("reality_gap.report.files.write_report", lambda *_: None)
    diagnosis = replace(diagnosed(Verdict.NAMED), posterior=posterior)
    write_diagnosis(diagnosis, lever_study, tmp_path / "out")
    return tmp_path / "out"


def test_a_folder_has_the_samples_of_its_diagnosis(folder: Path, posterior: Posterior) -> None:
    loaded = load_posterior(folder)

    np.testing.assert_array_equal(thetas(loaded, 6, 2), thetas(posterior, 6, 2))
    for one, two in zip(loaded.sample(3), posterior.sample(3), strict=True):
        expected = damping(two.spec.compile())
        assert damping(one.spec.compile()) == pytest.approx(expected, rel=1e-5)
        assert one.effects[0].values == two.effects[0].values


def test_the_command_writes_models_that_can_be_loaded(
    folder: Path, posterior: Posterior, tmp_path: Path
) -> None:
    out = tmp_path / "samples"
    arguments = ["sample", str(folder), "--out", str(out), "--count", "3", "--seed", "4"]

    assert main(arguments) == 0
    assert sorted(path.name for path in out.iterdir()) == ["sample_000", "sample_001", "sample_002"]
    for path, expected in zip(sorted(out.iterdir()), posterior.sample(3, 4), strict=True):
        found = load_extended(path)
        assert damping(found.spec.compile()) == pytest.approx(
            damping(expected.spec.compile()), rel=1e-4
        )
        assert found.effects == expected.effects
    assert main(arguments) == 2  # nothing is overwritten


def test_a_folder_without_posterior_is_refused(
    diagnosed: Make, lever_study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reality_gap.report.files.write_report", lambda *_: None)
    write_diagnosis(diagnosed(Verdict.UNEXPLAINED), lever_study, tmp_path / "out")

    with pytest.raises(StudyError, match=r"no posterior\.json .* that is not unexplained"):
        load_posterior(tmp_path / "out")


def test_an_unknown_cause_is_named(folder: Path) -> None:
    path = folder / "posterior.json"
    path.write_text(path.read_text().replace("length_offset", "gremlins"))

    with pytest.raises(UnknownNameError, match="'gremlins'"):
        load_posterior(folder)


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content["branches"].clear(),
        lambda content: content["branches"][0].update(weight=-1.0),
        lambda content: content["branches"][0]["covariance"].pop(),
        lambda content: content["branches"][0]["covariance"][0].__setitem__(0, -1.0),
        lambda content: content["branches"][0]["candidates"][0]["parameters"][0].pop("scale"),
        lambda content: content["branches"][0]["candidates"][0]["parameters"][0].update(low=9e9),
        lambda content: content.pop("study"),
        lambda content: content.update(model="../lever.xml"),
        lambda content: content["branches"][0].update(covariance=[[1.0], [2.0, 1.0]]),
        lambda content: content["branches"][0]["candidates"][0].update(elements=["nothing"]),
        lambda content: content["branches"][0]["candidates"][0].update(elements="flexor"),
        lambda content: content["branches"][0]["candidates"][0].update(elements=[]),
        lambda content: content["branches"][0]["candidates"][0].update(elements=[3]),
        lambda content: content["branches"][0]["candidates"][0].update(kind="gremlin"),
        lambda content: content["branches"][0]["candidates"][0].update(cause="gravity_direction"),
        lambda content: content["branches"][0]["candidates"][0]["parameters"][0].update(
            name="other"
        ),
        lambda content: content["branches"][0]["candidates"][0]["parameters"][0].update(value=1e9),
        lambda content: content["branches"][0]["candidates"][0].update(parameters=[]),
        lambda content: content["study"].update(duration=-1.0),
        lambda content: content["study"].update(duration=float("nan")),
        lambda content: content["study"].update(settle=1e12),
        lambda content: content["study"]["channels"][0].update(sensor="nothing"),
        lambda content: content["study"]["channels"][0].update(kind="nothing"),
    ],
)
def test_a_damaged_file_is_refused(folder: Path, damage: Callable[[Any], Any]) -> None:
    path = folder / "posterior.json"
    content = json.loads(path.read_text())
    damage(content)
    path.write_text(json.dumps(content))

    with pytest.raises(StudyError, match=r"posterior\.json (was not written|names the model)"):
        load_posterior(folder)


def test_what_is_no_folder_of_a_diagnosis_is_refused(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "wrong" / "posterior.json").mkdir(parents=True)
    none: Any = None

    for given in (folder / "posterior.json", tmp_path / "wrong", none):
        with pytest.raises(StudyError, match="the folder of a diagnosis"):
            load_posterior(given)


def test_folders_that_samples_cannot_use_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    used, file = tmp_path / "used", tmp_path / "file"
    used.mkdir()
    (used / "notes").touch()
    file.touch()

    for out, message in ((used, "used is not empty"), (file / "x", "x is in a file")):
        assert main(["sample", str(folder), "--out", str(out)]) == 2
        assert message in capsys.readouterr().err


CRANE = """<mujoco><option integrator="implicitfast"/><worldbody>
  <body name="boom"><joint name="swing" axis="0 1 0" range="-90 90"/>
    <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.03" mass="2"/>
    <body name="jib" pos="0.5 0 0"><joint name="lift" axis="0 1 0" range="-90 90"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.02" mass="1"/></body></body>
  </worldbody>
  <actuator><motor name="swing_motor" joint="swing" ctrlrange="-60 60" gear="2"/>
    <position name="lift_servo" joint="lift" kp="200" kv="9" forcerange="-40 40"/></actuator>
  <sensor><jointpos name="swing_angle" joint="swing"/><jointpos name="lift_angle" joint="lift"/>
  </sensor></mujoco>"""


@pytest.fixture
def crane(tmp_path: Path) -> System:
    """A motor and a servo at joints that moved slowly, and the effort of one."""
    path = tmp_path / "crane.xml"
    path.write_text(CRANE)
    time = np.linspace(0.0, 10.0, 501)
    command = np.stack([20.0 * np.sin(time), 0.2 * np.cos(time)], axis=1)
    readings = [0.04 * np.sin(time), 0.03 * np.cos(time), 3.0 * np.sin(time)]
    channels = (
        Channel("swing", "swing_angle", unit="rad"),
        Channel("lift", "lift_angle", unit="rad"),
        Channel("effort", "swing", unit="N m", kind="effort"),
    )
    episode = Episode("", time, command, tuple(Reading(time, value) for value in readings))
    return compile_system(Study("crane", path, channels, (episode,)))


@pytest.mark.parametrize("machine", ["system", "crane"])
def test_a_posterior_with_any_cause_is_loaded_without_the_readings(
    machine: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    system: System = request.getfixturevalue(machine)
    found = []
    for cause in CATALOGUE.values():
        for location in cause.locations(system):
            one = Candidate(cause, location, cause.parameters(system, location))
            values = {p.name: p.null + 0.1 * p.scale for p in one.parameters}
            found.append(Branch([(one, values)], 1e-4 * np.eye(len(values))))
    branches = tuple(replace(branch, weight=1.0 / len(found)) for branch in found)
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / MODEL).write_text(nominal_xml(system))
    write_posterior(Posterior(system, [], branches), folder / JSON)

    loaded = load_posterior(folder)

    assert joint_uses(loaded.system) == joint_uses(system)
    for before, after in zip(branches, loaded.branches, strict=True):
        one, other = (
            Posterior(own, [], (branch,)).sample(1)[0].spec.to_xml()
            for own, branch in ((system, before), (loaded.system, after))
        )
        assert other == one, before.hypothesis[0][0].cause.id
