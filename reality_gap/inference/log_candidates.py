"""Candidates that act in one of several logs, such as a load that was changed between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured

MOST = 8
"""Largest number of logs of which each has candidates of its own."""
PENALTY = float(np.log(MOST))
"""Penalty for the choice of a log [nats]."""
MEMORY = 1e9
"""Largest size of the columns of these candidates [bytes]."""


def in_each_log(
    study: Study, measured: Measured, sensitivities: Sequence[Sensitivity]
) -> tuple[Sensitivity, ...]:
    """Return the sensitivities of candidates that act in one log, for each log of a study.

    Episodes do not depend on each other, so that their columns are those of the same candidates in
    all logs, with zeros in the other logs. Events have a time already, and lie in one log.

    Args:
        study: the study.
        measured: its readings.
        sensitivities: of candidates that act in all logs.

    Returns:
        None of them if the study has one log, or more than `MOST`, or if they would need too much
        memory.
    """
    logs = study.logs
    lasting = [s for s in sensitivities if not any(p.hints.starts for p in s.candidate.parameters)]
    size = len(logs) * sum(one.columns.nbytes for one in lasting)
    if not 1 < len(logs) <= MOST or size > MEMORY:
        return ()
    found = []
    for log in logs:
        outside = ~np.isin(measured.episode, study.episodes_of(log))
        for one in lasting:
            columns = one.columns.copy()
            columns[outside] = 0.0
            if columns.any():
                found.append(replace(one, candidate=_in_log(one.candidate, log), columns=columns))
    return tuple(found)


def _in_log(candidate: Candidate, log: str) -> Candidate:
    return replace(candidate, location=replace(candidate.location, log=log))
