"""Candidates at chosen locations, and replays with one of them."""

from __future__ import annotations

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Location
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.system import System
from reality_gap.types import Floats
from tests.reality_gap.causes.machines import predict


def candidate(system: System, id: str, location: Location | str) -> Candidate:
    """The candidate of a cause at a location, or at that of this text."""
    cause = CATALOGUE[id]
    known = {str(one): one for one in cause.locations(system)}
    assert str(location) in known, f"{id} is at {list(known)}"
    found = known[str(location)]
    assert isinstance(location, str) or found == location
    return Candidate(cause, found, cause.parameters(system, found))


def with_cause(system: System, id: str, location: Location | str, **values: float) -> Floats:
    """The replay with one cause, in units of noise."""
    one = candidate(system, id, location)
    return predict(system, (one, one.null_values() | values))
