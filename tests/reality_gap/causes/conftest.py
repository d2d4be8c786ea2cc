"""Fixtures: systems that several tests of causes use."""

from __future__ import annotations

import pytest

from reality_gap.study.system import System, compile_system
from tests.reality_gap.causes.machines import arm_study, elbow_study, hand_study, screw_study
from tests.reality_gap.causes.plants import robot


@pytest.fixture(scope="session")
def systems(tmp_path_factory: pytest.TempPathFactory) -> dict[str, System]:
    folder = tmp_path_factory.mktemp("studies")
    return {
        "elbow": compile_system(elbow_study(folder)),
        "arm": compile_system(arm_study(folder)),
        "hand": compile_system(hand_study(folder)),
        "screw": compile_system(screw_study(folder)),
        "effort": compile_system(screw_study(folder, effort=True)),
    }


@pytest.fixture(scope="session")
def elbow(tmp_path_factory: pytest.TempPathFactory) -> System:
    return robot(tmp_path_factory.mktemp("elbow"), "elbow")


@pytest.fixture(scope="session")
def arm(tmp_path_factory: pytest.TempPathFactory) -> System:
    return robot(tmp_path_factory.mktemp("arm"), "arm")
