"""Variants of the agent for the ablation, and the claims that comparisons of them test."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

from jmm_agent.agent import AgentOptions
from jmm_agent.mapping.learner import BatchOptions
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.observation_fit import ObservationFitOptions

PAPER, DEFAULT, NONE = "paper", "default", "none"
"""The paper's plain rule, the default of the experiments, and no learning."""

RIDGE = None
"""The default rule, which the agent makes from its own prior."""


@dataclass(frozen=True)
class Variant:
    """A variant of the agent.

    Attributes:
        description: difference from the reference.
        reference: `PAPER` or `DEFAULT`, the variant that it is compared with.
        options: of the agent; without feed-forward, because maps alone command the robots that
            compare them.
        rule: update rule of the map; `RIDGE` for the default.
    """

    description: str
    reference: str
    options: AgentOptions = field(default_factory=AgentOptions)
    rule: MinibatchRule | None = RIDGE


PAPER_VISION = VisionOptions(lengths="l_target", fit="alone")
PAPER_OPTIONS = AgentOptions(vision=PAPER_VISION, feed_forward=False)

NO_ZERO = BatchOptions(zero=False)
NO_RANDOM = BatchOptions(rehearsal=0)
NO_REHEARSAL = BatchOptions(zero=False, rehearsal=0)
NO_BATCH = "without (0, 0) and random pairs"


def _paper(description: str, options: AgentOptions = PAPER_OPTIONS) -> Variant:
    return Variant(description, PAPER, options, MinibatchRule())


def _default(description: str, **options: Any) -> Variant:
    return Variant(description, DEFAULT, AgentOptions(feed_forward=False, **options))


def _steps(description: str, rule: MinibatchRule) -> Variant:
    return Variant(description, DEFAULT, AgentOptions(feed_forward=False), rule)


VARIANTS = {
    PAPER: _paper("each observation alone, l_target, ten minibatch steps on all layers"),
    "paper-no-zero": _paper("without (0, 0)", replace(PAPER_OPTIONS, batch=NO_ZERO)),
    "paper-no-random": _paper("without random pairs", replace(PAPER_OPTIONS, batch=NO_RANDOM)),
    "paper-no-rehearsal": _paper(NO_BATCH, replace(PAPER_OPTIONS, batch=NO_REHEARSAL)),
    "paper-l": _paper(
        "pair holds l",
        AgentOptions(vision=replace(PAPER_VISION, lengths="l"), feed_forward=False),
    ),
    "paper-antagonism": _paper(
        "Antagonism Updater alone", replace(PAPER_OPTIONS, learn_vision=False)
    ),
    "paper-vision": _paper("Vision Updater alone", replace(PAPER_OPTIONS, learn_antagonism=False)),
    DEFAULT: _default("all rests together, min(l, l_target), ridge on output layers"),
    "default-no-rehearsal": _default(NO_BATCH, batch=NO_REHEARSAL),
    "default-l": _default("pair holds l", vision=VisionOptions(lengths="l")),
    "default-l_target": _default("pair holds l_target", vision=VisionOptions(lengths="l_target")),
    "default-antagonism": _default("Antagonism Updater alone", learn_vision=False),
    "default-vision": _default("Vision Updater alone", learn_antagonism=False),
    "default-one-observation": _default(
        "each observation alone", vision=VisionOptions(fit="alone")
    ),
    "default-memory-10": _default(
        "memory of ten observations",
        vision=VisionOptions(observations=ObservationFitOptions(memory=10)),
    ),
    "default-steps": _steps("ten minibatch steps, all layers", MinibatchRule()),
    "default-steps-output": _steps(
        "ten minibatch steps, output layers", MinibatchRule(all_layers=False)
    ),
}
"""Variants by name."""

Outcome = Literal["target_true_deg", "estimate_seen_deg", "max_tension_N", "box_mm"]

SAME: dict[Outcome, float] = {
    "target_true_deg": 0.25,
    "estimate_seen_deg": 0.25,
    "max_tension_N": 20.0,
    "box_mm": 1.0,
}
"""Outcomes, of which low values are good, and differences that count as equal."""


@dataclass(frozen=True)
class Claim:
    """A claim that one variant is better than another, or not worse.

    Attributes:
        text: the claim in words.
        one: variant that is claimed to be better, or not worse.
        other: variant that it is compared with.
        outcome: quantity that is compared.
        kind: whether ``one`` is claimed to be better, or only not to be worse.
    """

    text: str
    one: str
    other: str
    outcome: Outcome
    kind: Literal["better", "not worse"] = "better"


def _rehearsal(of: str, part: str, left_out: str) -> list[Claim]:
    other = f"{of}-{left_out}"
    return [
        Claim(f"{part} prevents over-fitting of the map", of, other, "box_mm"),
        Claim(f"{part} lowers the error", of, other, "target_true_deg"),
    ]


def _no_competition(of: str) -> list[Claim]:
    tension: Outcome = "max_tension_N"
    return [
        Claim("learning by both updaters lowers the error", of, NONE, "target_true_deg"),
        Claim(
            "the updaters do not compete: error", of, f"{of}-vision", "target_true_deg", "not worse"
        ),
        Claim("the updaters do not compete: tension", of, f"{of}-antagonism", tension, "not worse"),
    ]


def _true(text: str, one: str, other: str) -> Claim:
    return Claim(text, one, other, "target_true_deg")


CLAIMS = {
    PAPER: [
        *_rehearsal(PAPER, "the pair (0, 0)", "no-zero"),
        *_rehearsal(PAPER, "rehearsal of random pairs", "no-random"),
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
            "fitting observations together is better than each alone",
            DEFAULT,
            "default-one-observation",
        ),
        _true("a memory of 60 observations is better than one of 10", DEFAULT, "default-memory-10"),
        _true("ridge is better than ten steps, all layers", DEFAULT, "default-steps"),
        _true("ridge is better than ten steps, output layers", DEFAULT, "default-steps-output"),
        _true("the default is better than the paper's plain rule", DEFAULT, PAPER),
    ],
}
"""Claims by the update rule, `PAPER` or `DEFAULT`, with which they are tested."""
