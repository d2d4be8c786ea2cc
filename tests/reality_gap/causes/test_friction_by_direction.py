"""Direction-dependent friction, on a cart on a rail that is tied to a tendon."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Location
from reality_gap.causes.support import lugre
from reality_gap.simulation.episode import Task, compile_with_probes, simulate
from reality_gap.simulation.hypothesis import Candidate, Plant, build, has_effects
from reality_gap.study.system import System
from reality_gap.types import Floats
from tests.reality_gap.simulation.cart import BEND, DAMPING, ON_RAIL, ON_TENDON, cart_system, ramp


def by_direction(system: System, location: Location) -> Plant:
    """The cart with friction of 6 N forward and 2 N backward, and none of its own."""
    cause = CATALOGUE["direction_dependent_friction"]
    candidate = Candidate(cause, location, cause.parameters(system, location))
    values = candidate.null_values() | {"forward": 6.0, "backward": 2.0}
    if lugre.is_available(system):
        values["presliding"] = BEND
    plant = build(system, [(candidate, values)])
    plant.spec.joint("rail").frictionloss -= 0.5
    return plant


def driven(plant: Plant, load: Floats) -> Floats:
    """Positions under a load (n,) [N]."""
    model = compile_with_probes(plant.spec, fuse=False)
    return simulate(model, Task(0.0, load[:, None], {}, {}, 0.0), plant.effects.hooks).qpos[:, 0]


@pytest.mark.parametrize("sensors", [(), ("sum_on_tendon", "sum_on_rail")])
@pytest.mark.parametrize("location", [ON_TENDON, ON_RAIL])
@pytest.mark.parametrize(("load", "left"), [(9.0, 3.0), (-5.0, -3.0)])
def test_each_direction_has_its_friction(
    tmp_path: Path, location: Location, sensors: tuple[str, ...], load: float, left: float
) -> None:
    plant = by_direction(cart_system(tmp_path, *sensors), location)
    assert bool(plant.effects.hooks) is bool(sensors)  # without hooks, MuJoCo runs the episode in C

    found = driven(plant, np.full(1500, load))

    assert float(found[-1] - found[-2]) / 0.002 == pytest.approx(left / DAMPING, rel=0.02)


@pytest.mark.parametrize("location", [ON_TENDON, ON_RAIL])
def test_at_rest_it_holds_with_the_friction_of_the_last_direction(
    tmp_path: Path, location: Location
) -> None:
    """The cart slides, and comes to rest under a load."""
    system = cart_system(tmp_path)

    def position(*corners: float) -> Floats:
        return driven(by_direction(system, location), ramp(*corners))

    forward, backward = position(0.0, 9.0, 5.4, 5.4), position(0.0, -3.0, -1.8, -1.8)
    for found, slid in ((forward, 0.05), (backward, -0.02)):
        assert found[8000] / slid > 1.0
        assert np.ptp(found[-4000:]) < 0.02 * BEND  # more than the mean of both, forward
    assert np.ptp(position(0.0, -3.0, -2.4, -2.4)[-4000:]) > 0.02  # less than that, backward


@pytest.mark.parametrize("location", [ON_TENDON, ON_RAIL])
@pytest.mark.parametrize("load", [0.0, 2.0])
def test_at_rest_half_the_difference_pushes_on_the_bristles(
    tmp_path: Path, location: Location, load: float
) -> None:
    """6 N forward and 2 N backward are friction of 4 N and a constant force of 2 N backward."""
    found = driven(by_direction(cart_system(tmp_path), location), ramp(2.0, load, load))

    bent = BEND * np.log(1.0 - (2.0 - load) / 4.0)
    assert found[-1] == pytest.approx(bent, rel=0.05, abs=0.02 * BEND)


def test_on_a_tendon_it_needs_no_hook(tmp_path: Path) -> None:
    cause = CATALOGUE["direction_dependent_friction"]
    system = cart_system(tmp_path)

    def needs_hook(location: Location) -> bool:
        candidate = Candidate(cause, location, cause.parameters(system, location))
        values = {p.name: p.null + p.scale for p in candidate.parameters}
        return has_effects(system, candidate, values | {"backward": 0.0, "backward_viscous": 0.0})

    assert not needs_hook(ON_TENDON)
    assert needs_hook(ON_RAIL)  # viscous friction by direction needs a hook
