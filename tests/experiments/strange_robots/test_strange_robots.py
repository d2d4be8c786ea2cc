"""Strange robots: what each family changes, metrics of made-up results, and a short run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Results
from experiments.strange_robots.families import (
    ABSENT,
    BONES,
    DRIFT,
    FAMILIES,
    LENS,
    NOISE,
    POINTS,
    PRESET,
    SOFT,
    SWAPPED,
    base,
    make_robot,
)
from experiments.strange_robots.figures import pictures
from experiments.strange_robots.run import QUICK, chosen, run, with_long
from experiments.strange_robots.tables import (
    COMMISSIONED,
    CONDITIONS,
    NEVER,
    metrics,
    per_seed,
    tables,
)
from experiments.strange_robots.trial import Named, Sizes
from experiments.strange_robots.wrappers import simulated
from kengoro.robots import shuffled_postures
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures import LensDistortion, ZeroPosture, actual
from kengoro_env.robot.robot import Robot

SEED = 3
SIZES = Sizes(counts=(1, 5), long=9, loads=(0.0, 0.5))


def start() -> dict[str, Any]:
    posture = shuffled_postures(SEED)[0]
    return {"posture": posture, "target": posture}


def model_of(departures: Any) -> mujoco.MjModel:
    return Robot(asset_path(ARM), departures).model


def test_points_are_displaced_by_ten_millimetres_and_the_zero_is_exact() -> None:
    assert not any(isinstance(one, ZeroPosture) for one in FAMILIES[POINTS].departures(SEED))
    nominal, moved = model_of(base(SEED)), model_of(FAMILIES[POINTS].departures(SEED))
    shift = (moved.site_pos - nominal.site_pos)[np.any(moved.site_pos != nominal.site_pos, axis=1)]
    assert len(shift) > 60
    assert np.sqrt(np.mean(shift**2)) == pytest.approx(0.010, rel=0.15)
    assert np.abs(shift).max() > 0.022  # not clipped


def test_bones_are_moved_by_five_millimetres_and_axes_turned_by_three_degrees() -> None:
    nominal, moved = model_of(base(SEED)), model_of(FAMILIES[BONES].departures(SEED))
    steps = np.linalg.norm(moved.body_pos - nominal.body_pos, axis=1)
    assert (steps > 1e-6).sum() >= 6
    assert steps[steps > 1e-6].max() < 0.0151  # a body with three joints moves three times
    joints = [nominal.joint(name).id for name in simulated(make_robot(BONES, SEED, False)).joints]
    turns = np.sum(nominal.jnt_axis * moved.jnt_axis, axis=1)[joints]
    assert np.degrees(np.arccos(turns)) == pytest.approx(3.0, abs=1e-3)


def test_tendons_are_five_times_softer_and_encoders_have_three_times_the_noise() -> None:
    soft, usual = (model_of(FAMILIES[name].departures(SEED)) for name in (SOFT, PRESET))
    tendons = usual.tendon_stiffness > 0
    assert usual.tendon_stiffness[tendons] / soft.tendon_stiffness[tendons] == pytest.approx(5.0)
    spread = {}
    for name in (PRESET, NOISE):
        robot = simulated(make_robot(name, SEED, False)).robot
        robot.reset(shuffled_postures(SEED)[0], np.random.default_rng(0))
        readings = np.array([robot.measured_lengths() for _ in range(400)])
        spread[name] = float(readings.std(axis=0).mean())
    assert spread[NOISE] / spread[PRESET] == pytest.approx(3.0, rel=0.1)


def test_the_lens_is_a_barrel_and_all_else_is_the_presets() -> None:
    assert FAMILIES[LENS].departures(SEED) == (*actual(SEED), LensDistortion(k1=-0.2))
    for name, lens in ((LENS, (-0.2, 0.0, 0.0, 0.0, 0.0)), (PRESET, None)):
        env = make_robot(name, SEED)
        assert simulated(env).robot.lens == lens
        env.close()


def test_swapped_motors_exchange_readings_and_commands() -> None:
    plain, swapped = make_robot(PRESET, SEED, False), make_robot(SWAPPED, SEED, False)
    world = simulated(plain)
    one, other = (world.muscles.index(m) for m in FAMILIES[SWAPPED].odd(SEED, world.muscles))
    assert other == one + 1
    before, after = (env.reset(seed=0, options=start())[0] for env in (plain, swapped))
    for name in ("lengths", "tensions"):
        assert after[name][one] == before[name][other]
        assert after[name][other] == before[name][one]
    command = before["lengths"].copy()
    command[one] -= 0.004
    exchanged = after["lengths"].copy()
    exchanged[other] -= 0.004
    for _ in range(25):
        before = plain.step(world.lengths_to_action(command))[0]
        after = swapped.step(world.lengths_to_action(exchanged))[0]
    np.testing.assert_allclose(after["tensions"][other], before["tensions"][one], atol=1e-3)
    for env in (plain, swapped):
        env.close()


def test_an_absent_muscle_never_pulls_again() -> None:
    env = make_robot(ABSENT, SEED, False)
    observation, _ = env.reset(seed=0, options=start())
    world = simulated(env)
    [name] = FAMILIES[ABSENT].odd(SEED, world.muscles)
    hold = world.lengths_to_action(observation["lengths"])
    tensions = [env.step(hold) and world.robot.tensions for _ in range(20 * 50)]
    assert np.max(np.array(tensions)[5:, world.muscles.index(name)]) == 0.0
    assert np.max(np.delete(tensions[-1], world.muscles.index(name))) > 20.0
    env.close()


def test_lengths_drift_by_a_millimetre_a_minute_and_stay_in_a_test() -> None:
    begun, later = make_robot(DRIFT, SEED, False), make_robot(DRIFT, SEED, False, 90.0, True)
    for env in (begun, later):
        env.reset(seed=0, options=start())
    world = simulated(begun)
    command = world.lengths_to_action(world.robot.target)
    first = [simulated(env).robot.motors.elongation.copy() for env in (begun, later)]
    for _ in range(10 * 50):
        begun.step(command)
        later.step(command)
    drifted, stayed = (simulated(env).robot.motors.elongation for env in (begun, later))
    assert np.abs(drifted - first[0]) == pytest.approx(0.001 / 6.0, rel=0.12)
    assert np.abs(first[1]) == pytest.approx(0.0015)
    np.testing.assert_array_equal(stayed, first[1])
    assert len(set(np.sign(first[1]))) == 2
    for env in (begun, later):
        env.close()


def test_muscles_count_as_named_when_all_of_them_were() -> None:
    named = Named()
    named.faults["muscles_swapped", "biceps and triceps"] = ("they are exchanged", 3)
    named.warnings["The wire of delt_ant gave."] = 4
    assert named.first(("biceps", "triceps")) == 3
    assert named.first(("delt_ant",)) == 4
    assert named.first(("biceps", "delt_post")) is None


def test_a_fault_of_two_muscles_is_false_if_one_of_them_is_intact() -> None:
    named, muscles = Named(), ("biceps", "triceps", "delt_ant")
    named.faults["muscles_swapped", "biceps and triceps"] = ("they are exchanged", 3)
    named.faults["lengths_drift", "muscles"] = ("they drift", 5)
    assert named.wrong(("triceps",), muscles) == ["muscles_swapped biceps and triceps"]
    assert named.wrong(("biceps", "triceps"), muscles) == []


def results() -> Results:
    """Two robots: 10 deg and 100 mm before, 1 deg and 10 mm on the preset after, others more."""
    made: Results = {}
    for seed in range(2):
        robot: dict[str, Any] = {}
        for rank, condition in enumerate(CONDITIONS):
            counts = SIZES.counts_of(COMMISSIONED.get(condition, condition))
            each = {"0": 10.0} | {str(count): 1.0 + 0.1 * rank for count in counts}
            errors = {
                count: {"target_true_deg": x, "target_true_mm": 10.0 * x, "max_tension_N": 99.0}
                for count, x in each.items()
            }
            odd = ["biceps"] if condition in (SWAPPED, ABSENT) else []
            robot[condition] = {
                "errors": errors, "odd": odd, "named_after": 4 if odd and seed else None,
                "false_names": [], "faults": [["kind", "biceps", 4, ""]], "events": 0,
                "tension_N": 99.0,
            }  # fmt: skip
        loaded = {
            "mass_kg": 0.5, "std_kg": 0.1, "target_true_deg": 1.3, "target_true_mm": 20.0,
            "max_tension_N": 99.0,
        }  # fmt: skip
        robot[SOFT]["loads"] = {"0": loaded | {"target_true_deg": 1.0}, "0.5": loaded}
        robot["swapped-commissioned"]["commissioning"] = {"found": [["swapped", "a", "b"]]}
        made[seed] = robot
    made[1][POINTS]["errors"]["1"]["target_true_mm"] = 120.0
    return made


def test_metrics_are_errors_ratios_to_the_preset_and_numbers_of_observations() -> None:
    named = metrics(results(), SIZES)
    assert named["points_error_deg"]["median"] == pytest.approx(1.1)
    assert named["points_error_deg"]["reached"]
    assert named["bones_error_mm"]["must"] is None
    assert named["lens_over_preset_deg"]["median"] == pytest.approx(1.4)
    assert named["drift_over_preset_mm"]["median"] == pytest.approx(1.7)
    assert not named["drift_over_preset_mm"]["reached"]
    worse = named["points_largest_share_of_error_before_mm"]
    assert worse["worst"] == pytest.approx(1.2)
    assert not worse["reached"]
    assert named["soft_with_0.5_kg_over_empty_deg"]["reached"]
    assert named["swapped_named_after"]["worst"] == NEVER
    assert not named["swapped_named_after"]["reached"]


def test_tables_and_figure_show_all_conditions() -> None:
    joints, hands, loads, named = tables(results(), SIZES)
    assert len(joints.rows) == len(hands.rows) == len(CONDITIONS)
    assert [row[-1] for row in joints.rows][:5] == ["", "1.2 deg", "1.2 deg", "1.4 deg", "1.5 x"]
    assert joints.rows[0][1:5] == ("10.0 (10.0)", "1.0 (1.0)", "1.0 (1.0)", "1.0 (1.0)")
    assert joints.rows[1][4] == ""
    assert loads.rows[1][:2] == ("0.5", "0.50")
    assert loads.rows[1][4:6] == ("1.3 (1.3)", "20.0 (20.0)")
    row = next(row for row in named.rows if row[0] == SWAPPED and row[1] == 1)
    assert row[3] == 4
    made = results()
    made[1][SWAPPED]["named_after"] = 0
    row = next(row for row in tables(made, SIZES)[3].rows if row[:2] == (SWAPPED, 1))
    assert row[3] == 0
    row = next(row for row in named.rows if row[0] == "swapped-commissioned" and row[1] == 1)
    assert (row[3], row[4]) == ("", "swapped a b")
    for odd, after in ((["a", "b"], "before"), (["a", "c"], "never")):
        made[1]["swapped-commissioned"]["odd"] = odd
        rows = tables(made, SIZES)[3].rows
        assert next(row[3] for row in rows if row[:2] == ("swapped-commissioned", 1)) == after
    assert per_seed(results())[0][LENS]["errors"]["5"] == [1.4, 14.0]
    [picture] = pictures(results(), SIZES)
    assert len(picture.png) > 10_000


@pytest.mark.parametrize(
    "condition", [DRIFT, pytest.param("swapped-commissioned", marks=pytest.mark.slow)]
)
def test_a_short_run_learns(condition: str, request: pytest.FixtureRequest) -> None:
    cache = Path(request.config.cache.mkdir("maps"))
    found = run(condition, 0, QUICK, cache)
    counts = ["0", *map(str, QUICK.counts_of(COMMISSIONED.get(condition, condition)))]
    assert list(found["errors"]) == counts
    assert found["errors"][counts[-1]]["target_true_deg"] < found["errors"]["0"]["target_true_deg"]
    assert found["learned"] >= 1
    if condition == DRIFT:
        assert found["odd"] == []
        assert "commissioning" not in found
    else:
        [[kind, *muscles]] = found["commissioning"]["found"]
        assert kind == "swapped"
        assert sorted(muscles) == sorted(found["odd"])
        assert found["commissioning"]["refused"] == ""


def test_robots_that_drift_have_more_observations_than_others() -> None:
    assert with_long(Sizes(), 60) == Sizes(long=60)
    with pytest.raises(ExperimentError, match="Long is 27 looks, but must be more than the 27"):
        with_long(Sizes(), 27)


def test_some_of_the_robots_are_run_and_reported_beside_the_preset() -> None:
    assert chosen(()) == CONDITIONS
    assert chosen((DRIFT, BONES)) == (PRESET, BONES, DRIFT)
    with pytest.raises(ExperimentError, match=r"Unknown robots \['drifts'\]; robots are preset,"):
        chosen(("drifts",))
    some = {seed: {name: one[name] for name in (PRESET, DRIFT)} for seed, one in results().items()}
    assert set(metrics(some, SIZES)) == {"drift_over_preset_deg", "drift_over_preset_mm"}
    joints, hands, named = tables(some, SIZES)
    assert len(joints.rows) == len(hands.rows) == 2
    assert len(named.rows) == 4
    assert list(per_seed(some)[0]) == [PRESET, DRIFT]
    assert len(pictures(some, SIZES)) == 1
