"""Files of hand detectors whose networks give known outputs, made with the onnx package."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from jmm_agent.types import Floats
from jmm_agent.vision.hand_model_file import HandModel, write_hand_model

POINTS = np.array(
    [
        [0.03, 0.0, 0.0],
        [-0.03, 0.0, 0.0],
        [0.0, 0.05, -0.08],
        [0.0, 0.01, -0.1],
        [0.03, 0.02, -0.05],
    ]
)
MODEL = HandModel("hand", tuple(map(tuple, POINTS.tolist())), 64, 145.0)


def constant_network(output: Floats) -> bytes:
    """A network that adds a constant output to the mean of its input times zero."""
    value = np.asarray(output, dtype=np.float32)
    axes = numpy_helper.from_array(np.arange(4, dtype=np.int64), "axes")
    zero = numpy_helper.from_array(np.zeros(1, dtype=np.float32), "zero")
    nodes = [
        helper.make_node("ReduceMean", ["picture"], ["mean"], axes=[1, 2, 3], keepdims=0),
        helper.make_node("Mul", ["mean", "zero"], ["nothing"]),
        helper.make_node("Add", ["constant", "nothing"], ["output"]),
    ]
    graph = helper.make_graph(
        nodes, "constant",
        [helper.make_tensor_value_info("picture", TensorProto.FLOAT, [1, 3, "h", "w"])],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, list(value.shape))],
        [numpy_helper.from_array(value, "constant"), zero],
    )  # fmt: skip
    del axes
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def write_constant_detector(
    path: Path, finder: Floats, points: Floats, model: HandModel = MODEL
) -> None:
    """A detector whose networks always give the same.

    Args:
        path: of the file.
        finder: output (4, rows, columns).
        points: output (5 n + 1,).
        model: what they are about.
    """
    write_hand_model(path, model, constant_network(finder[None]), constant_network(points[None]))
