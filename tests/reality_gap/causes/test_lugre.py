"""Dry friction of a cart on a rail that is tied to a tendon, compared with the LuGre model."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.causes.base import Location
from reality_gap.causes.support import lugre
from reality_gap.study.system import System
from reality_gap.types import Floats
from tests.reality_gap.simulation.cart import (
    BEND,
    DAMPING,
    ON_RAIL,
    ON_TENDON,
    Kind,
    cart_system,
    ramp,
)

LEVEL = 4.0
"""Friction [N]."""
ON_BOTH = Location("tendon", ("tendon", "rope"))


def braked(
    system: System, location: Location, level: float = LEVEL, bend: float = BEND
) -> mujoco.MjSpec:
    """The cart without friction of its own, with that of bristles."""
    spec = system.study.spec()
    spec.joint("rail").frictionloss = 0.0
    lugre.add_friction(spec, system, "rub", location, level, {"presliding": bend})
    return spec


def pull(model: mujoco.MjModel, load: Floats) -> Floats:
    """Positions of the cart (k,) while the motor pulls with ``load`` (k,) [N]."""
    data, positions = mujoco.MjData(model), np.empty(len(load))
    for k, force in enumerate(load):
        data.ctrl[0] = force
        mujoco.mj_step(model, data)
        positions[k] = data.qpos[0]
    return positions


def law(load: Floats | float) -> Floats:
    """How far bristles bend under a load: F = level (1 - exp(-x / bend)), for x [m]."""
    return -BEND * np.log(1.0 - np.asarray(load) / LEVEL)


@pytest.mark.parametrize("location", [ON_TENDON, ON_RAIL])
def test_the_force_rises_over_the_presliding_distance(tmp_path: Path, location: Location) -> None:
    model = braked(cart_system(tmp_path), location).compile()
    load = ramp(0.0, 0.9 * LEVEL)

    found = pull(model, load)

    at = [2000, 4000, 6000, 7999]
    np.testing.assert_allclose(found[at], law(load[at]), rtol=0.05, atol=0.01 * BEND)


def test_it_holds_a_load_below_its_level(tmp_path: Path) -> None:
    load = np.concatenate([ramp(0.0, 0.8 * LEVEL), np.full(4000, 0.8 * LEVEL)])

    found = pull(braked(cart_system(tmp_path), ON_TENDON).compile(), load)

    assert found[-1] == pytest.approx(float(law(load[-1])), rel=0.1)
    assert abs(found[-1] - found[-2000]) < 0.02 * BEND  # no creep


@pytest.mark.parametrize("bend", [3e-4, 3e-5, 3e-6])
def test_motion_without_other_damping_comes_to_rest(tmp_path: Path, bend: float) -> None:
    model = braked(cart_system(tmp_path, damping=0.0), ON_TENDON, bend=bend).compile()

    found = pull(model, ramp(0.0, 0.5 * LEVEL, 0.5 * LEVEL))

    assert np.ptp(found[-4000:]) < 0.02 * bend  # no oscillation, no creep


def test_above_its_level_it_slides_against_its_level(tmp_path: Path) -> None:
    found = pull(braked(cart_system(tmp_path), ON_TENDON).compile(), np.full(1500, 2.5 * LEVEL))

    speed = (found[-1] - found[-2]) / 0.002
    assert speed == pytest.approx(1.5 * LEVEL / DAMPING, rel=0.01)


def test_without_load_the_bristles_recover_in_part(tmp_path: Path) -> None:
    """On the way back F starts from that on the way out, and falls as level (2 exp(x/bend) - 1)."""
    there, back = law(0.9 * LEVEL), np.log((1.0 + 0.9) / (1.0 + 0.0)) * BEND

    found = pull(braked(cart_system(tmp_path), ON_TENDON).compile(), ramp(0.0, 0.9 * LEVEL, 0.0))

    assert found[-1] == pytest.approx(float(there) - back, rel=0.05)


def test_each_element_of_a_location_has_its_own_friction(tmp_path: Path) -> None:
    model = braked(cart_system(tmp_path), ON_BOTH).compile()
    load = ramp(0.0, 1.8 * LEVEL)

    found = pull(model, load)

    np.testing.assert_allclose(found[-1], law(load[-1] / 2), rtol=0.05)


@pytest.mark.parametrize("location", [ON_TENDON, ON_BOTH, ON_RAIL])
def test_no_command_is_added(tmp_path: Path, location: Location) -> None:
    system = cart_system(tmp_path)
    model = braked(system, location).compile()

    assert model.nu == system.model.nu
    assert model.nactuator == system.model.nactuator + len(location.elements)


@pytest.mark.parametrize("mass", [0.02, 0.2, 2.0])
@pytest.mark.parametrize("location", [ON_TENDON, ON_RAIL])
def test_the_stiffness_is_limited_for_light_bodies(
    tmp_path: Path, mass: float, location: Location
) -> None:
    """An oscillation of angular frequency w is followed by steps h while (w h)^2 is far below 4."""
    system = cart_system(tmp_path, mass=mass, damping=100.0 * mass)
    model = braked(system, location, bend=1e-7).compile()

    found = pull(model, ramp(0.0, 0.8 * LEVEL))

    stiffness = float(model.actuator_dynprm[-1, lugre.STIFFNESS])
    assert stiffness * model.opt.timestep**2 / mass < 0.5
    assert found[-1] == pytest.approx(law(0.8 * LEVEL) / BEND * LEVEL / stiffness, rel=0.1)


def test_the_stiffness_is_as_specified_for_heavy_bodies(tmp_path: Path) -> None:
    model = braked(cart_system(tmp_path), ON_TENDON).compile()

    assert model.actuator_dynprm[-1, lugre.STIFFNESS] == pytest.approx(LEVEL / BEND)


@pytest.mark.parametrize(
    ("measured", "kind"),
    [("sum_on_tendon", "sensor"), ("sum_on_rail", "sensor"), ("rail", "effort")],
)
def test_sums_of_forces_need_frictionloss(tmp_path: Path, measured: str, kind: Kind) -> None:
    system = cart_system(tmp_path, measured, kind=kind)
    spec = system.study.spec()
    lugre.add_friction(spec, system, "rub", ON_BOTH, LEVEL, {"presliding": BEND})
    lugre.add_friction(spec, system, "rub", ON_RAIL, LEVEL, {"presliding": BEND})
    model = spec.compile()

    assert not lugre.is_available(system)
    assert model.nactuator == system.model.nactuator
    np.testing.assert_allclose(model.tendon_frictionloss, LEVEL)
    assert model.dof_frictionloss[0] == pytest.approx(0.5 + LEVEL)  # on top of its own


def test_sensors_that_are_not_measured_have_no_influence(tmp_path: Path) -> None:
    assert lugre.is_available(cart_system(tmp_path))


@pytest.mark.parametrize("sensors", [(), ("sum_on_tendon",)])
def test_frictionloss_holds_and_slides_at_the_same_level(
    tmp_path: Path, sensors: tuple[str, ...]
) -> None:
    model = braked(cart_system(tmp_path, *sensors), ON_TENDON).compile()

    below, above = (pull(model, np.full(1500, share * LEVEL)) for share in (0.6, 1.6))

    assert np.all(below < 3 * BEND)
    speed = (above[-1] - above[-2]) / 0.002
    assert speed == pytest.approx(0.6 * LEVEL / DAMPING, rel=0.02)


@pytest.mark.parametrize("location", [ON_TENDON, ON_BOTH, ON_RAIL])
@pytest.mark.parametrize("sensors", [(), ("sum_on_tendon",)])
def test_scaled_friction_holds_more(
    tmp_path: Path, sensors: tuple[str, ...], location: Location
) -> None:
    system = cart_system(tmp_path, *sensors)
    count = len(location.elements)

    def speed(factor: float, share: float) -> float:
        """Speed after 3 s under a share of the level of all elements before scaling [m/s]."""
        model = braked(system, location).compile()
        friction = lugre.VariableFriction(model, system, "rub", location)
        friction.scale(LEVEL, 7.0)  # replaced by the next call
        friction.scale(LEVEL, factor)
        found = pull(model, np.full(1500, share * count * LEVEL))
        return float(found[-1] - found[-2]) / 0.002

    too_much = count * LEVEL / DAMPING  # speed under a force of all levels
    assert speed(2.0, share=1.4) == pytest.approx(0.0, abs=0.01 * too_much)
    assert speed(1.0, share=1.4) == pytest.approx(0.4 * too_much, rel=0.02)
    assert speed(0.0, share=1.4) == pytest.approx(1.4 * too_much, rel=0.02)


@pytest.mark.parametrize("location", [ON_TENDON, ON_BOTH])
def test_a_replay_that_diverged_is_no_error_of_mujoco(tmp_path: Path, location: Location) -> None:
    system = cart_system(tmp_path)
    model = braked(system, location).compile()
    friction = lugre.VariableFriction(model, system, "rub", location)

    friction.scale(LEVEL, np.full(len(location.elements), np.nan))

    assert np.isfinite(pull(model, ramp(0.0, LEVEL))).all()


def test_each_element_can_be_scaled_alone(tmp_path: Path) -> None:
    system = cart_system(tmp_path)
    model = braked(system, ON_BOTH).compile()

    lugre.VariableFriction(model, system, "rub", ON_BOTH).scale(LEVEL, np.array([2.0, 0.5]))

    load = ramp(0.0, 2.25 * LEVEL)
    # Stiffness grows with the level, so that both together have 2.5 times that of one.
    np.testing.assert_allclose(pull(model, load)[-1], law(load[-1] / 2.5), rtol=0.05)


@pytest.mark.parametrize("location", [ON_TENDON, ON_RAIL])
def test_the_usual_presliding_is_its_null(tmp_path: Path, location: Location) -> None:
    found = lugre.presliding_parameter(cart_system(tmp_path), location)

    assert found.low < found.null < found.high
    assert found.unit == "m"  # the rail is straight


@pytest.mark.parametrize("location", [ON_TENDON, ON_RAIL])
@pytest.mark.parametrize("creep", [0.002, 0.05])
def test_friction_that_creeps_is_proportional_to_a_low_velocity(
    tmp_path: Path, location: Location, creep: float
) -> None:
    system = cart_system(tmp_path)
    spec = system.study.spec()
    spec.joint("rail").frictionloss = 0.0
    lugre.add_friction(spec, system, "rub", location, LEVEL, {"creep": creep})

    found = pull(spec.compile(), np.full(4000, 0.5 * LEVEL))

    speed = (found[-1] - found[-1001]) / (1000 * 0.002)
    assert speed * (LEVEL / creep + DAMPING) == pytest.approx(0.5 * LEVEL, rel=0.02)


def test_friction_that_creeps_is_limited(tmp_path: Path) -> None:
    system = cart_system(tmp_path)
    spec = system.study.spec()
    spec.joint("rail").frictionloss = 0.0
    lugre.add_friction(spec, system, "rub", ON_RAIL, LEVEL, {"creep": 0.01})

    found = pull(spec.compile(), np.full(1500, 2.5 * LEVEL))

    speed = (found[-1] - found[-2]) / 0.002
    assert speed == pytest.approx(1.5 * LEVEL / DAMPING, rel=0.01)


@pytest.mark.parametrize("impedance", [0.0, 1.0])
def test_impedances_that_mujoco_clips_are_clipped(tmp_path: Path, impedance: float) -> None:
    system = cart_system(tmp_path)
    found = []
    for own in (impedance, np.clip(impedance, 1e-4, 0.9999)):
        spec = system.study.spec()
        rail = spec.joint("rail")
        rail.frictionloss = 0.5 * LEVEL
        rail.solimp_friction = (own, own, *rail.solimp_friction[2:])
        lugre.add_friction(spec, system, "rub", ON_RAIL, LEVEL, {"creep": 0.02})
        found.append(pull(spec.compile(), np.full(500, 0.5 * LEVEL))[-1])

    assert found[0] == found[1]


def test_friction_loss_that_a_model_has_goes_on_creeping(tmp_path: Path) -> None:
    """What is added creeps beside the model's own friction: the slopes of both add up."""
    system, own, added, creep = cart_system(tmp_path), 0.5 * LEVEL, 0.7 * LEVEL, 0.02
    slope = 2.0 / (0.95 * 0.02) * 0.9 / 0.1 / float(system.model.dof_invweight0[0])  # of MuJoCo
    spec = system.study.spec()
    spec.joint("rail").frictionloss = own
    lugre.add_friction(spec, system, "rub", ON_RAIL, added, {"creep": creep})

    found = pull(spec.compile(), np.full(6000, 0.5 * LEVEL))

    speed = (found[-1] - found[-1001]) / (1000 * 0.002)
    assert speed * (slope + added / creep + DAMPING) == pytest.approx(0.5 * LEVEL, rel=0.03)
