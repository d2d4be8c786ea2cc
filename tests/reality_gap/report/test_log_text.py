"""Values in each log and what a log cannot show, in the report, the terminal and verdict.json."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from reality_gap.diagnosis import Diagnosis, Estimate, Verdict
from reality_gap.log_findings import FlatDirection, LogComparison, LogValue, Remedy
from reality_gap.report.html import page
from reality_gap.report.log_text import flat_line, log_lines
from reality_gap.report.verdict_json import verdict_json
from reality_gap.study.data import Study

Make = Callable[[Verdict], Diagnosis]


@pytest.fixture
def several(diagnosed: Make) -> Diagnosis:
    """A diagnosis of two logs, between which a friction has changed."""
    found = diagnosed(Verdict.NAMED)
    friction, offset = found.causes
    changed = LogComparison(
        (
            LogValue("monday", {"friction": Estimate(3.0, 2.5, 3.5, "N")}),
            LogValue("tuesday", {"friction": Estimate(5.0, 4.5, 5.5, "N")}),
        ),
        "changed",
        1e-4,
    )
    hidden = LogComparison(
        (
            LogValue("monday", {"offset": Estimate(0.0025, 0.002, 0.003, "m")}),
            LogValue("tuesday", {}),
        ),
        "unknown",
        None,
    )
    remedy = Remedy("slow sweeps", 30.0, 0.2, "lever", 40.0)
    flat = (
        FlatDirection((friction.candidate,), True, 1.2, remedy),
        FlatDirection((friction.candidate, offset.candidate), False, 2.2, None),
        FlatDirection((offset.candidate,), True, 0.5, None, False),
    )
    causes = (replace(friction, logs=changed), replace(offset, logs=hidden))
    return replace(found, causes=causes, flat=flat)


def test_the_terminal_has_the_values_of_each_log(several: Diagnosis) -> None:
    friction, offset = log_lines(several)
    assert "monday 3.00 N (2.50 to 3.50 N), tuesday 5.00 N (4.50 to 5.50 N)" in friction
    assert "changed (such differences have a probability of < 1 %)" in friction
    assert "monday 2.50 mm (2.00 to 3.00 mm), tuesday does not show" in offset
    assert "unknown, because it shows in monday only" in offset


def test_a_cause_of_all_logs_and_of_one_has_one_line(several: Diagnosis) -> None:
    friction = several.causes[0]
    location = replace(friction.candidate.location, log="tuesday")
    more = replace(friction, candidate=replace(friction.candidate, location=location))
    assert len(log_lines(replace(several, causes=(more, friction)))) == 1


def test_the_terminal_shows_what_the_log_cannot(several: Diagnosis) -> None:
    line = flat_line(several)
    assert "coulomb friction and length offset" in line
    assert "one group of causes with the same effect" in line
    assert "30 s of slow sweeps with 200 g added at lever would show most of it" in line
    assert flat_line(replace(several, flat=())) == ""


@pytest.mark.usefixtures("no_figures")
def test_the_report_has_both(several: Diagnosis, lever_study: Study) -> None:
    text = page(several, lever_study)
    for part in (
        "<td>tuesday</td><td>friction</td><td>5.00 N</td>",
        "Between the logs: changed",
        "30 s of slow sweeps with 200 g added at lever (40 noises)",
        "coulomb friction at flexor or length offset at extensor",
        "none of the motions that were tried",
        "not computed",
    ):
        assert part in text


def test_the_verdict_has_both(several: Diagnosis) -> None:
    found = verdict_json(several)
    logs = found["causes"][0]["logs"]
    assert logs["agreement"] == "changed"
    assert logs["values"][1]["parameters"]["friction"]["value"] == 5.0
    assert found["causes"][1]["logs"]["values"][1]["parameters"] == {}
    first, second, _ = found["flat"]
    assert first["remedy"] == {
        "motion": "slow sweeps",
        "seconds": 30.0,
        "mass": 0.2,
        "body": "lever",
        "change": 40.0,
    }
    assert [one["elements"] for one in second["candidates"]] == [["flexor"], ["extensor"]]


@pytest.mark.usefixtures("no_figures")
def test_what_acts_in_one_log_is_not_in_the_model(several: Diagnosis, lever_study: Study) -> None:
    friction = several.causes[0]
    location = replace(friction.candidate.location, log="tuesday")
    more = replace(friction, candidate=replace(friction.candidate, location=location))
    text = page(replace(several, causes=(more,)), lever_study)
    assert "It does not hold what acts in one of them only" in text
    assert "This acts in tuesday only" in text
