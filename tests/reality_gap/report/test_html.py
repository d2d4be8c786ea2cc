"""The page: right for each verdict, in readable units, and complete without a network."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable
from dataclasses import replace
from html import escape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from reality_gap.diagnosis import STOP, Criterion, Diagnosis, Gain, Share, Verdict
from reality_gap.report.html import page
from reality_gap.report.plots.candidates import as_likely, by_step
from reality_gap.report.plots.canvas import png
from reality_gap.report.plots.signals import residual_map, signals
from reality_gap.report.plots.waterfall import waterfall
from reality_gap.study.data import Study

Make = Callable[[Verdict], Diagnosis]
VOID = {"meta", "img", "br", "link"}


class Reader(HTMLParser):
    """Parser of a page: its text, its tags, its sources, and elements that are not closed."""

    def __init__(self) -> None:
        super().__init__()
        self.text = ""
        self.open: list[str] = []
        self.sources: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.text += " "
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text += data


def read(html: str) -> Reader:
    """Parse a page; white space in its text becomes one blank."""
    reader = Reader()
    reader.feed(html)
    reader.text = " ".join(reader.text.split())
    return reader


@pytest.mark.parametrize("verdict", Verdict)
def test_a_page_is_complete_and_needs_no_network(
    verdict: Verdict, diagnosed: Make, lever_study: Study
) -> None:
    diagnosis = diagnosed(verdict)

    found = read(page(diagnosis, lever_study))

    assert found.open == []
    assert "script" not in found.tags
    assert len(found.sources) >= 5
    for source in found.sources:
        assert source.startswith("data:image/png;base64,")
        assert base64.b64decode(source.split(",")[1]).startswith(b"\x89PNG")
    assert diagnosis.sentence in found.text


@pytest.mark.usefixtures("blank_pictures")
def test_a_named_cause_has_readable_units(diagnosed: Make, lever_study: Study) -> None:
    found = read(page(diagnosed(Verdict.NAMED), lever_study)).text

    assert "Length offset extensor offset 2.50 mm 2.00 to 3.00 mm 88 % length scale" in found
    assert "Coulomb friction flexor friction 3.00 N 2.50 to 3.50 N 93 % none" in found
    assert re.search(r'\+ *<general name="coulomb_friction/flexor"[^>]*biasprm="0 0 0 3 3', found)
    assert "removes 96 % of the error above the floor (95 % interval 93 % to 97 %)" in found
    assert "camera focal nothing to act on" in found


@pytest.mark.parametrize(("chance", "mentioned"), [(0.31, True), (0.01, False), (None, False)])
@pytest.mark.usefixtures("no_figures")
def test_the_probability_of_an_unknown_cause_is_mentioned(
    chance: float | None, mentioned: bool, diagnosed: Make, lever_study: Study
) -> None:
    diagnosis = replace(diagnosed(Verdict.NAMED), unmodelled=chance)

    found = read(page(diagnosis, lever_study)).text

    assert ("with a probability of 31 % none of the known causes is right" in found) is mentioned


@pytest.mark.usefixtures("no_figures")
@pytest.mark.parametrize("verdict", [Verdict.NAMED, Verdict.PARTLY_NAMED])
def test_a_page_with_names_opens_with_the_waterfall_and_has_a_section_a_cause(
    verdict: Verdict, diagnosed: Make, lever_study: Study
) -> None:
    found = read(page(diagnosed(verdict), lever_study)).text

    opening, first, second, rest = (
        found.index(text)
        for text in (
            "from top to bottom: what deviations within the tolerances remove",
            "Coulomb friction at flexor",
            "Length offset at extensor",
            "What your model gets wrong",
        )
    )
    assert opening < first < second < rest
    assert "On held-out data it removes 73 % of the error above the noise" in found[first:second]
    assert "by 50.0 nats (95 % interval 30.0 to 70.0)" in found[first:second]
    known = "Its confidence is 93 %; the rest is that of another known cause in its place (7 %)."
    assert known in found[first:second]
    assert "88 %; the rest is that of an unknown cause (12 %)." in found[second:rest]
    partly = "More is wrong than that: the extended model leaves errors above the noise" in found
    assert partly is (verdict is Verdict.PARTLY_NAMED)


@pytest.mark.usefixtures("no_figures")
@pytest.mark.parametrize("verdict", [Verdict.PARTLY_NAMED, Verdict.UNEXPLAINED])
def test_an_attempt_is_shown_with_its_values_and_is_no_change(
    verdict: Verdict, diagnosed: Make, lever_study: Study
) -> None:
    found = read(page(diagnosed(verdict), lever_study)).text

    text = "Length offset extensor offset 0 mm it has a parameter at its bound"
    assert text in found
    assert ("The best attempt" in found) is (verdict is Verdict.UNEXPLAINED)


@pytest.mark.usefixtures("no_figures")
@pytest.mark.parametrize("met", [False, True])
def test_a_stop_is_the_likeliest_cause_of_what_is_left(
    met: bool, diagnosed: Make, lever_study: Study
) -> None:
    stop = Criterion(STOP, 50.0, 5.0, met, "explains less than an end stop of jy would")

    found = read(page(replace(diagnosed(Verdict.UNEXPLAINED), criteria=(stop,)), lever_study)).text

    assert (
        "The remaining error shows most in length_flexor. A joint that runs" in found
    ) is not met
    assert ("depends most on velocity sign of elbow" in found) is met


@pytest.mark.usefixtures("no_figures")
@pytest.mark.parametrize("verdict", Verdict)
def test_a_page_begins_with_the_notes_on_the_study(
    verdict: Verdict, diagnosed: Make, lever_study: Study
) -> None:
    notes = ("effort of <b>joint4</b> has the opposite sign", "two links touch")
    diagnosis = diagnosed(verdict)

    found = read(page(replace(diagnosis, notes=notes), lever_study)).text

    assert found.index("Notes on the study") < found.index(notes[0]) < found.index(notes[1])
    assert found.index(notes[1]) < found.index(diagnosis.sentence)
    refers = "Consider the 2 notes on the study above first" in found
    assert refers is (verdict is Verdict.UNEXPLAINED)
    for none in ((), None):
        without = read(page(replace(diagnosis, notes=none), lever_study)).text
        assert "otes on the study" not in without


@pytest.mark.usefixtures("no_figures")
def test_no_share_is_all(diagnosed: Make, lever_study: Study) -> None:
    diagnosis = diagnosed(Verdict.NAMED)
    share = Share("all", 12.0, 1.0, 1.0)
    causes = tuple(replace(cause, confidence=1.0, share=share) for cause in diagnosis.causes)
    sure = replace(diagnosis, causes=causes, gain=Gain(1.0, 0.999, 1.001))

    found = read(page(sure, lever_study)).text

    assert "> 99 %" in found
    assert "100 %" not in found


def test_no_rejected_candidate_stands_above_the_chosen_one(diagnosed: Make) -> None:
    """The other candidate has a higher score on the selection split alone."""
    diagnosis = diagnosed(Verdict.NAMED)

    for step in by_step(diagnosis.fitted_candidates):
        assert step[0].chosen
        rejected = [one for one in step[1:] if not as_likely(one, step)]
        assert all(one.evidence < step[0].evidence for one in rejected)


def test_a_candidate_that_is_as_likely_is_not_marked_as_rejected(diagnosed: Make) -> None:
    first, second, *_ = diagnosed(Verdict.NAMED).fitted_candidates
    step = [first, replace(second, evidence=first.evidence + 0.5)]

    assert by_step(tuple(step))[0][0] is first
    assert as_likely(step[1], step)


def test_the_waterfall_shows_what_each_part_removes(diagnosed: Make) -> None:
    steps = diagnosed(Verdict.NAMED).waterfall

    texts = [text.get_text().strip() for text in waterfall(steps, 1.0, 1).axes[0].texts]

    assert texts == [
        "12.0",
        "12.0 to 11.0, 16 %",
        "11.0 to 4.00, 73 %",
        "4.00 to 1.50, 10 %",
        "1.50",
        "1.00",
    ]


@pytest.mark.usefixtures("blank_pictures")
def test_nothing_wrong_promises_neither_gain_nor_truth(diagnosed: Make, lever_study: Study) -> None:
    diagnosis = replace(
        diagnosed(Verdict.NOTHING_WRONG), fitted_candidates=(), next_experiment=None
    )

    found = read(page(diagnosis, lever_study)).text

    assert "removes" not in found
    assert "does not prove that the model is right in other motions" in found
    assert "extended.xml is your model" in found
    assert "learned residual" not in found


@pytest.mark.usefixtures("no_figures")
def test_an_unexplained_error_has_no_name_but_a_dependence(
    diagnosed: Make, lever_study: Study
) -> None:
    found = read(page(diagnosed(Verdict.UNEXPLAINED), lever_study)).text

    assert "removes" not in found
    assert "an unknown cause cannot be added to a model" in found
    assert "depends most on velocity sign of elbow (40 % of it, in length_flexor)" in found
    assert "It is not a cause" in found


@pytest.mark.usefixtures("blank_pictures")
def test_without_a_named_cause_there_are_no_candidates_to_distinguish(
    diagnosed: Make, lever_study: Study
) -> None:
    diagnosis = replace(diagnosed(Verdict.UNEXPLAINED), next_experiment=None)

    found = read(page(diagnosis, lever_study)).text

    assert "RMS of your model, in units" in found
    assert "there are no candidates to distinguish, and a longer log does not reveal" in found
    assert "halve the uncertainty" not in found


@pytest.mark.usefixtures("no_figures")
def test_names_are_text_and_never_markup(diagnosed: Make, lever_study: Study) -> None:
    diagnosis = replace(diagnosed(Verdict.NAMED), study="<script>alert(1)</script>")

    found = read(page(diagnosis, lever_study))

    assert "script" not in found.tags
    assert "<script>alert(1)</script>" in found.text


@pytest.mark.usefixtures("blank_pictures")
def test_a_model_that_diverges_has_a_page(diagnosed: Make, lever_study: Study) -> None:
    diagnosis = diagnosed(Verdict.UNEXPLAINED)
    nothing = tuple(replace(t, before=np.full_like(t.before, np.nan)) for t in diagnosis.traces)

    found = read(page(replace(diagnosis, traces=nothing), lever_study)).text

    assert "it diverges on this log" in found


@pytest.mark.usefixtures("no_figures")
def test_equal_diagnoses_have_equal_pages(diagnosed: Make, lever_study: Study) -> None:
    diagnosis = diagnosed(Verdict.NAMED)

    assert page(diagnosis, lever_study) == page(diagnosis, lever_study)


def test_equal_pictures_have_equal_bits(diagnosed: Make) -> None:
    found = signals(diagnosed(Verdict.NAMED).traces)

    assert png(residual_map(found)) == png(residual_map(found))


BAD_NAME = "<script>alert('{{7*7}}')</script>$\\frac{$&quot;"
"""Name of an element that must not be interpreted as HTML, as a template or as mathematics."""


@pytest.fixture
def hostile(diagnosed: Make, lever_study: Study, tmp_path: Path) -> tuple[Diagnosis, Study]:
    """A diagnosis in which all names are `BAD_NAME`."""
    model = tmp_path / "<script>alert(1)<.xml"
    text = lever_study.model.read_text(encoding="utf-8")
    model.write_text(text.replace('"flexor"', f'"{escape(BAD_NAME)}"'), encoding="utf-8")
    study = replace(lever_study, name=BAD_NAME, model=model)
    good = diagnosed(Verdict.NAMED)
    assert good.next_experiment is not None
    location = replace(good.causes[0].candidate.location, elements=(BAD_NAME,), note=BAD_NAME)
    cause = replace(good.causes[0], candidate=replace(good.causes[0].candidate, location=location))
    bad = replace(
        good,
        study=BAD_NAME,
        sentence=BAD_NAME,
        causes=(cause, *good.causes[1:]),
        fitted_candidates=tuple(
            replace(fitted, candidate=cause.candidate) for fitted in good.fitted_candidates
        ),
        depends_on=tuple(replace(d, channel=BAD_NAME, quantity=BAD_NAME) for d in good.depends_on),
        next_experiment=replace(good.next_experiment, title=BAD_NAME, sentence=BAD_NAME),
        not_judged=((BAD_NAME, BAD_NAME),),
        traces=tuple(
            replace(trace, channel=f"{BAD_NAME} {trace.channel}", episode=BAD_NAME)
            for trace in good.traces
        ),
        effects=((cause.candidate, {"force": 1.0}),),
        extended_xml=good.extended_xml + BAD_NAME,
    )
    return bad, study


@pytest.mark.usefixtures("no_figures")
def test_names_from_untrusted_files_are_text_only(hostile: tuple[Diagnosis, Study]) -> None:
    found = read(page(*hostile))

    assert "script" not in found.tags
    assert found.text.count(BAD_NAME) >= 5


@pytest.mark.slow
def test_names_from_untrusted_files_can_be_plotted(hostile: tuple[Diagnosis, Study]) -> None:
    page(*hostile)
