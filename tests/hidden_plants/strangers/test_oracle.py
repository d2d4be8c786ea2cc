"""Oracle of the strangers: what it sees is no product of its simulations."""

from __future__ import annotations

import numpy as np
import pytest

from hidden_plants.secret import Effect
from hidden_plants.strangers import Oracle, make_stranger
from hidden_plants.strangers.inverse import seen_torques
from hidden_plants.strangers.mechanisms import MECHANISMS
from hidden_plants.strangers.mismatch import mismatch_at, mismatch_size
from hidden_plants.strangers.oracle import THRESHOLD
from hidden_plants.strangers.plant import real_step
from hidden_plants.strangers.readings import real_run, run, whitened

EFFORTS = 10
"""Machine with a log of torques."""


def test_a_mass_within_its_mismatch_is_not_seen() -> None:
    """Friction of the quick simulation is another one, by which a share of any change differs."""
    stranger = make_stranger(446, 4.0)  # one link moved by two tendons, friction as large as it
    mass = 0.02 * 3.0**-0.5 * float(stranger.model.body("link1").mass[0])
    effect = Effect("link_mass", ("link1",), {"sign": -1.0, "size": mass}, mass)

    assert Oracle(stranger).distance(effect) < THRESHOLD


@pytest.mark.slow
def test_an_effect_within_a_mismatch_of_its_kind_is_not_seen_where_deviations_grow() -> None:
    """In open loop the changes are not linear, so that linear mismatches do not make up for it."""
    stranger = make_stranger(431, 4.0)
    shares = {"less_damping": 0.05, "less_stiffness": 0.02}
    sizes = {"armature": 0.05 * stranger.model.dof_armature[2]}
    sizes |= {"viscous_friction": 0.05 * stranger.model.dof_damping.ravel()[2]}
    sizes |= {"link_mass": 0.02 * stranger.model.body("link3").mass[0]}
    oracle = Oracle(stranger)
    for id, size in (shares | sizes).items():
        element = "link3" if id == "link_mass" else "j3"
        effect = Effect(
            id, (element,), {"sign": 1.0, "size": float(size), "on_joint": 1.0}, float(size)
        )
        assert oracle.distance(effect) <= 3.0**0.5 + 1e-9, id
    gain = Effect("force_scale", ("m_j3",), {"sign": -1.0, "size": 0.01}, 0.01)
    assert oracle.distance(gain) <= 3.0**0.5 + 1e-9


@pytest.mark.slow
def test_a_real_machine_has_no_physics_step() -> None:
    stranger = make_stranger(418, 2.0)  # stiff servos, which multiply errors of positions
    none = mismatch_at(stranger, np.zeros(mismatch_size(stranger)))
    finest = run(stranger, none, (), real_step(stranger) / 16.0)

    found = whitened(stranger, real_run(stranger, none, ()))

    assert np.sqrt(np.mean((found - whitened(stranger, finest)) ** 2)) < 0.5


def test_noise_of_positions_is_in_what_a_log_of_torques_shows() -> None:
    """Seen at each frequency: what noise of one standard deviation in all readings leaves."""
    stranger = make_stranger(EFFORTS, 8.0)
    none = mismatch_at(stranger, np.zeros(mismatch_size(stranger)))
    clean = whitened(stranger, run(stranger, none, (), real_step(stranger)))
    noise = np.random.default_rng(1).standard_normal(len(clean))

    seen = seen_torques(stranger, clean + noise) - seen_torques(stranger, clean)

    parts = np.array_split(seen[: len(stranger.commands[0][0])], 10)
    # Readings fade at the ends, and a spline differentiates the highest frequencies twice or more.
    assert all(0.5 < np.std(part) < 2.0 for part in parts)


def test_coupled_readings_are_no_crosstalk() -> None:
    """An encoder that reads a share of the joint before has a name in the catalogue."""
    rng = np.random.default_rng(0)
    for seed in range(12):
        stranger = make_stranger(seed, 2.0)
        for structure in MECHANISMS["crosstalk"].structures(stranger, rng):
            receiver, source = (
                next(s for s in stranger.sensors if s.name == name) for name in structure.elements
            )
            if receiver.kind == source.kind == "position":
                parent = stranger.skeleton.links[receiver.index].parent
                assert source.index != parent
