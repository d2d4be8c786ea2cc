"""Picture of how the networks of a hand detector learned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from mjcf_sandbox.files import whole_file


def draw_curves(path: Path, curves: Mapping[str, Sequence[Sequence[float]]]) -> None:
    """Draw the losses of networks over what they learned from.

    Args:
        path: of the picture (PNG).
        curves: of each network, by its name: rows of the number of examples, the loss on them, and
            the loss on examples that are not learned from.
    """
    figure = Figure(figsize=(4.5 * len(curves), 3.4), layout="constrained")
    for axes, (name, curve) in zip(figure.subplots(1, len(curves), squeeze=False)[0],
                                   curves.items(), strict=True):  # fmt: skip
        samples, learned, new = zip(*curve, strict=True)
        axes.plot(samples, learned, color="0.6", label="learned from")
        axes.plot(samples, new, color="tab:blue", label="not learned from")
        axes.set(title=f"{name} network", xlabel="examples [1]", ylabel="loss [1]")
        axes.legend()
        axes.grid(alpha=0.3)
    with whole_file(path) as beside:
        figure.savefig(beside, dpi=110, format="png")
