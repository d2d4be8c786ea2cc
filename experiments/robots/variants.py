"""What is left out or exchanged in the ablation, and which claims of the paper that tests."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

from jmm_agent.agent import AgentOptions
from jmm_agent.mapping.learner import BatchOptions
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.observation_fit import ObservationFitOptions

PAPER, DEFAULT, NONE = "paper", "default", "none"
"""The paper's plain rule, what the experiments use, and no learning at all."""

RIDGE = None
"""The default rule: the agent makes it of its own prior."""


@dataclass(frozen=True)
class Variant:
    """One way to learn.

    Attributes:
        told: what is changed from the reference.
        reference: `PAPER` or `DEFAULT`, the variant that it is compared with.
        options: of the agent.
        rule: how the map is moved; `RIDGE` for the default.
    """

    told: str
    reference: str
    options: AgentOptions = field(default_factory=AgentOptions)
    rule: MinibatchRule | None = RIDGE


PAPER_VISION = VisionOptions(lengths="l_target", fit="alone")
PAPER_OPTIONS = AgentOptions(vision=PAPER_VISION)

NO_ZERO = BatchOptions(zero=False)
NO_RANDOM = BatchOptions(rehearsal=0)
NO_REHEARSAL = BatchOptions(zero=False, rehearsal=0)
NO_BATCH = "without (0, 0) and random pairs"


def _paper(told: str, options: AgentOptions = PAPER_OPTIONS) -> Variant:
    return Variant(told, PAPER, options, MinibatchRule())


def _default(told: str, **options: Any) -> Variant:
    return Variant(told, DEFAULT, AgentOptions(**options))


def _steps(told: str, rule: MinibatchRule) -> Variant:
    return Variant(told, DEFAULT, AgentOptions(), rule)


VARIANTS = {
    PAPER: _paper("each look alone, l_target, ten minibatch steps on all layers"),
    "paper-no-zero": _paper("without (0, 0)", replace(PAPER_OPTIONS, batch=NO_ZERO)),
    "paper-no-random": _paper("without random pairs", replace(PAPER_OPTIONS, batch=NO_RANDOM)),
    "paper-no-rehearsal": _paper(NO_BATCH, replace(PAPER_OPTIONS, batch=NO_REHEARSAL)),
    "paper-l": _paper("pair holds l", AgentOptions(vision=replace(PAPER_VISION, lengths="l"))),
    "paper-antagonism": _paper(
        "Antagonism Updater alone", replace(PAPER_OPTIONS, learn_vision=False)
    ),
    "paper-vision": _paper("Vision Updater alone", replace(PAPER_OPTIONS, learn_antagonism=False)),
    DEFAULT: _default("looks together, min(l, l_target), ridge on output layers"),
    "default-no-rehearsal": _default(NO_BATCH, batch=NO_REHEARSAL),
    "default-l": _default("pair holds l", vision=VisionOptions(lengths="l")),
    "default-l_target": _default("pair holds l_target", vision=VisionOptions(lengths="l_target")),
    "default-antagonism": _default("Antagonism Updater alone", learn_vision=False),
    "default-vision": _default("Vision Updater alone", learn_antagonism=False),
    "default-one-observation": _default("each look alone", vision=VisionOptions(fit="alone")),
    "default-memory-10": _default(
        "ten looks are remembered",
        vision=VisionOptions(observations=ObservationFitOptions(memory=10)),
    ),
    "default-steps": _steps("ten minibatch steps, all layers", MinibatchRule()),
    "default-steps-output": _steps(
        "ten minibatch steps, output layers", MinibatchRule(all_layers=False)
    ),
}
"""By name, what learns."""

Outcome = Literal["target_true_deg", "estimate_seen_deg", "max_tension_N", "box_mm"]

SAME: dict[Outcome, float] = {
    "target_true_deg": 0.25,
    "estimate_seen_deg": 0.25,
    "max_tension_N": 20.0,
    "box_mm": 1.0,
}
"""Outcomes, low is good, and differences below which two variants count as equally good."""


@dataclass(frozen=True)
class Claim:
    """That one variant is better than another, or not worse.

    Attributes:
        told: the claim in words.
        one: variant that it speaks for.
        other: variant that it is compared with.
        outcome: what is compared.
        kind: whether ``one`` is claimed to be better, or only not to be worse.
    """

    told: str
    one: str
    other: str
    outcome: Outcome
    kind: Literal["better", "not worse"] = "better"


def _rehearsal(of: str, told: str, left_out: str) -> list[Claim]:
    other = f"{of}-{left_out}"
    return [
        Claim(f"{told} keeps the map from over-fitting", of, other, "box_mm"),
        Claim(f"{told} lowers the error", of, other, "target_true_deg"),
    ]


def _no_competition(of: str) -> list[Claim]:
    tension: Outcome = "max_tension_N"
    return [
        Claim("learning by both updaters lowers the error", of, NONE, "target_true_deg"),
        Claim("both do not compete: error", of, f"{of}-vision", "target_true_deg", "not worse"),
        Claim("both do not compete: tension", of, f"{of}-antagonism", tension, "not worse"),
    ]


def _true(told: str, one: str, other: str) -> Claim:
    return Claim(told, one, other, "target_true_deg")


CLAIMS = {
    PAPER: [
        *_rehearsal(PAPER, "the pair (0, 0)", "no-zero"),
        *_rehearsal(PAPER, "rehearsing random pairs", "no-random"),
        *_rehearsal(PAPER, "the whole rehearsal batch", "no-rehearsal"),
        _true("l_target is better than l", PAPER, "paper-l"),
        *_no_competition(PAPER),
    ],
    DEFAULT: [
        *_rehearsal(DEFAULT, "the whole rehearsal batch", "no-rehearsal"),
        _true("l_target is better than l", "default-l_target", "default-l"),
        _true("min(l, l_target) is better than l_target", DEFAULT, "default-l_target"),
        *_no_competition(DEFAULT),
        _true(
            "fitting looks together is better than each alone", DEFAULT, "default-one-observation"
        ),
        _true("remembering 60 looks is better than 10", DEFAULT, "default-memory-10"),
        _true("ridge is better than ten steps, all layers", DEFAULT, "default-steps"),
        _true("ridge is better than ten steps, output layers", DEFAULT, "default-steps-output"),
        _true("the default is better than the paper's plain rule", DEFAULT, PAPER),
    ],
}
"""Claims by the rule with which they are tested."""
