"""Weights of a trained network, read from its ONNX file, as the start of another training.

An exported network has its batch normalisations folded into its convolutions. They are unfolded
with the means and variances of a batch of pictures, so that the network computes the same as before
and goes on to learn.
"""

from __future__ import annotations

from pathlib import Path

import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

FOLDED = "_bias"
"""Ends the name of a convolution's bias that a batch normalisation was folded into."""


def start_from(network: nn.Module, path: Path, pictures: Tensor) -> tuple[int, int]:
    """Set those weights of a network that a trained one has in the same shape.

    Args:
        network: whose weights are set.
        path: of the trained network, as ONNX.
        pictures: a batch that the network takes.

    Returns:
        Number of arrays of the trained network that were taken, and number that it has.

    Raises:
        ValueError: none of them fits.
    """
    stored = {
        each.name: torch.from_numpy(numpy_helper.to_array(each).copy())
        for each in onnx.load(path).graph.initializer
    }
    parameters = dict(network.named_parameters())
    fitting = {
        name: value
        for name, value in stored.items()
        if name in parameters and value.shape == parameters[name].shape
    }
    if not fitting:
        raise ValueError(f"no weights of {path.name} fit to the network")
    network.load_state_dict(fitting, strict=False)
    _unfold(network, {name: stored.get(name + FOLDED) for name in fitting}, pictures)
    return len(fitting), sum(name.endswith((".weight", ".bias")) for name in stored)


def _unfold(network: nn.Module, biases: dict[str, Tensor | None], pictures: Tensor) -> None:
    """Set batch normalisations so that convolutions with folded biases compute as before."""

    def set_norm(norm: nn.BatchNorm2d, bias: Tensor, features: Tensor) -> None:
        mean, variance = features.mean(dim=(0, 2, 3)), features.var(dim=(0, 2, 3))
        norm.running_mean, norm.running_var = mean, variance
        norm.weight.copy_((variance + norm.eps).sqrt())
        norm.bias.copy_(mean + bias.to(mean))

    modules, hooks = dict(network.named_modules()), []
    for name, bias in biases.items():
        before, _, last = name.removesuffix(".weight").rpartition(".")
        norm = modules.get(f"{before}.{int(last) + 1}") if last.isdigit() else None
        if bias is not None and isinstance(norm, nn.BatchNorm2d):
            hooks.append(
                norm.register_forward_pre_hook(
                    lambda each, inputs, bias=bias: set_norm(each, bias, inputs[0])
                )
            )
    with torch.no_grad():
        network.eval()
        network(pictures)
        network.train()
    for hook in hooks:
        hook.remove()
