"""Results of diagnosis trials for tests, without running any."""

from __future__ import annotations

from typing import Any

Named = tuple[str, list[str], dict[str, float]]
"""A cause, its elements, and its parameters."""


def make_trial(
    kind: str = "single",
    hidden: tuple[Named, ...] = (("coulomb_friction", ["biceps"], {"force": 4.0}),),
    named: tuple[Named, ...] = (),
    verdict: str | None = None,
    **more: Any,
) -> dict[str, Any]:
    """Result of a trial as it is saved, without running it."""
    causes = [
        {
            "cause": cause,
            "elements": elements,
            "elsewhere": more.pop("elsewhere", []),
            "note": "",
            "parameters": {k: [v, v, v] for k, v in numbers.items()},
            "confidence": 0.9,
            "equivalent": more.pop("equivalent", []),
        }
        for cause, elements, numbers in named
    ]
    trial = {
        "case": {"kind": kind, "seed": more.pop("seed", 1), "machine": "elbow"},
        "truth": [
            {"cause": cause, "elements": elements, "parameters": numbers, "amplitude": 1.0}
            for cause, elements, numbers in hidden
        ],
        "verdict": verdict or ("named" if named else "nothing_wrong"),
        "causes": causes,
        "candidates": [],
        "gain": None,
        "true_model": None,
        "length_error": None,
        "bend": None,
        "followup": None,
        "baselines": {
            "correlation": {"cause": "delay", "elements": ["biceps"], "score": 0.1},
            "free_parameters": None,
        },
        "seconds": 20.0,
    }
    return trial | more


FRICTION: Named = ("coulomb_friction", ["biceps"], {"friction": 5.0})
