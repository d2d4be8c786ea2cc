"""Friction between a motor's force sensor and an elastic cable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap import Verdict, diagnose
from reality_gap.causes import CATALOGUE
from reality_gap.inference.screening import list_candidates
from reality_gap.inference.verdict import Options
from reality_gap.simulation.hypothesis import Part
from reality_gap.simulation.replayer import Replayer
from reality_gap.types import Bools
from tests.reality_gap.causes.cable_drive import DRIVE, FINGER, WINCH, Size, logged

KINDS = ("tendon_elasticity", "motor_side_friction", "coulomb_friction", "viscous_friction")


@pytest.mark.parametrize(
    ("size", "unit"), [(DRIVE, 1.0), (FINGER, 1.0), (WINCH, 1.0), (DRIVE, 0.02)]
)
def test_the_force_is_that_of_a_simulated_spool(tmp_path: Path, size: Size, unit: float) -> None:
    with Replayer(logged(tmp_path, size, unit=unit)) as replayer:
        listed = list_candidates(replayer.system, [CATALOGUE[id] for id in KINDS[:2]])
        elastic, rubbing = (
            next(one for one in listed if one.cause.id == id and len(one.location.elements) == 1)
            for id in KINDS[:2]
        )
        stretched = (elastic, {"compliance": 1.0 / size.sizes["cable"]})
        friction = rubbing.null_values() | {"friction": size.sizes["friction"]}
        forces, positions = (replayer.measured.channel == k for k in (0, 1))

        def left(*parts: Part, of: Bools = forces) -> float:
            return float(np.sqrt(np.mean(replayer.residual(parts)[of] ** 2)))

        assert left(stretched) > 10.0
        assert left(stretched, (rubbing, friction)) < 0.4 * left(stretched)
        assert left(stretched, (rubbing, friction), of=positions) < 1.3


@pytest.mark.slow
@pytest.mark.parametrize("size", [DRIVE, FINGER])
def test_it_is_named_beside_the_elasticity_of_the_cable(tmp_path: Path, size: Size) -> None:
    causes = [CATALOGUE[id] for id in KINDS]
    found = diagnose(logged(tmp_path, size), causes=causes, options=Options(suggest=False))

    assert found.verdict.has_names
    named = {one.candidate.cause.id: one for one in found.causes}
    assert set(named) == {"tendon_elasticity", "motor_side_friction"}
    friction = named["motor_side_friction"].parameters["friction"]
    assert friction.value == pytest.approx(size.sizes["friction"], rel=0.1)
    compliance = named["tendon_elasticity"].parameters["compliance"]
    assert compliance.value == pytest.approx(1.0 / size.sizes["cable"], rel=0.03)


def test_a_motor_that_does_not_rub_gets_no_such_name(tmp_path: Path) -> None:
    causes = [CATALOGUE[id] for id in KINDS]
    study = logged(tmp_path, DRIVE, friction=0.0)
    found = diagnose(study, causes=causes, options=Options(suggest=False))

    assert found.verdict is Verdict.NAMED
    assert [one.candidate.cause.id for one in found.causes] == ["tendon_elasticity"]
