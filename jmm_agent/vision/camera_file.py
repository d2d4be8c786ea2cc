"""Camera calibrations of OpenCV and ROS: files in YAML or XML, and ``CameraInfo`` messages.

Keys are compared without case and underscores. Lists are the only values that are read, so that a
file of unknown origin can do no more than fail.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from reprlib import repr as short
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import yaml

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats

MAX_BYTES = 1 << 20
"""Largest file [bytes]."""
MAX_NUMBERS = 64
"""Most numbers in a matrix."""
MAX_PX = 1 << 16
"""Largest width or height of a frame [px]."""
SKEW = 1e-6
"""Largest skew of the pixels, as a share of the focal length."""

WIDTH, HEIGHT = ("image_width", "width"), ("image_height", "height")
MATRIX = ("camera_matrix", "k", "m")
DISTORTION = ("distortion_coefficients", "dist_coeffs", "dist_coefs", "distortion", "d")
MODEL, FISHEYE = ("distortion_model",), ("fisheye_model",)
MODELS = {
    "plumb_bob": "plumb_bob",
    "rational_polynomial": "rational_polynomial",
    "equidistant": "fisheye",
    "fisheye": "fisheye",
}
"""Lens models by their names in ROS and here."""


class CameraInfo(NamedTuple):
    """Arguments of `Camera`."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...]
    model: str


class Message(NamedTuple):
    """Camera of the full frame, joined columns and rows, and region (left, top, width, height)."""

    info: CameraInfo
    binning: tuple[int, int]
    region: tuple[int, int, int, int] | None


def read_camera_file(path: Path) -> CameraInfo:
    """Read the calibration of a camera.

    Args:
        path: YAML or XML file of OpenCV's FileStorage, or YAML file of ROS.

    Raises:
        AgentError: the file is missing, too large or malformed, or a value is missing or wrong.
    """
    if not path.is_file():
        raise AgentError(f"There is no camera file at {path}.")
    with path.open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise AgentError(f"{path} is larger than {MAX_BYTES >> 20} MiB, too large for a camera.")
    try:
        text = content.decode("utf-8-sig")
        tree = _xml(text) if text.lstrip().startswith("<") else _yaml(text)
    except (yaml.YAMLError, ElementTree.ParseError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:200] or "nested too deeply"
        raise AgentError(f"{path} is not valid YAML or XML: {reason}.") from error
    except (LookupError, AttributeError, TypeError) as error:  # PyYAML on a wrong tag or key
        raise AgentError(f"{path} is not valid YAML: a value does not fit its tag.") from error
    if not isinstance(tree, Mapping):
        raise AgentError(f"{path} holds {short(tree)}; keys such as camera_matrix are expected.")
    return _info(_Fields(tree, str(path)))


def camera_info(message: Mapping[str, Any] | object) -> Message:
    """Read a ``sensor_msgs/CameraInfo`` message.

    Args:
        message: message of ROS 1 or ROS 2, or a mapping with its fields.

    Raises:
        AgentError: a field is missing or wrong.
    """
    fields = _Fields(_mapping(message), "CameraInfo")
    binning = tuple(max(fields.integer((key,), 0), 1) for key in ("binning_x", "binning_y"))
    roi, region = fields.get(("roi",)), None
    if roi is not None:
        part = _Fields(_mapping(roi), "CameraInfo, roi")
        width, height = part.integer(WIDTH, 0), part.integer(HEIGHT, 0)
        if width or height:
            region = (part.integer(("x_offset",), 0), part.integer(("y_offset",), 0), width, height)
    return Message(_info(fields), (binning[0], binning[1]), region)


class _Fields:
    """Values by key; keys are compared without case and underscores.

    Args:
        values: the values.
        source: where they come from, for messages.
    """

    def __init__(self, values: Mapping[Any, Any], source: str) -> None:
        self._values = {_plain(str(key)): value for key, value in values.items()}
        self.source = source

    def fault(self, text: str) -> AgentError:
        """Error whose message begins with the source."""
        return AgentError(f"{self.source}: {text}.")

    def get(self, names: Sequence[str]) -> Any:
        """Value of the first name that is there; None if none is."""
        return next((self._values[n] for n in map(_plain, names) if n in self._values), None)

    def integer(self, names: Sequence[str], default: int | None = None) -> int:
        """A whole number from 0 to `MAX_PX`."""
        value = self.get(names)
        if value is None:
            if default is None:
                raise self.fault(f"{names[0]} is missing")
            return default
        number = _number(value)
        if not (number == int(number if np.isfinite(number) else -1) and 0 <= number <= MAX_PX):
            raise self.fault(f"{names[0]} is {short(value)}; 0 to {MAX_PX} is valid")
        return int(number)

    def numbers(self, names: Sequence[str]) -> Floats | None:
        """A list, nested lists, or a matrix with ``data``, as a flat array; None if missing."""
        value = self.get(names)
        if isinstance(value, Mapping):
            value = _Fields(value, self.source).get(("data",))
        if value is None:
            return None
        rows = list(value) if _is_list(value) else [value]
        flat = [x for row in rows[:MAX_NUMBERS] for x in (row if _is_list(row) else [row])]
        array = np.array([_number(x) for x in flat[: MAX_NUMBERS + 1]])
        if len(flat) > MAX_NUMBERS or len(rows) > MAX_NUMBERS or not np.isfinite(array).all():
            raise self.fault(f"{names[0]} is {short(value)}; finite numbers are expected")
        return array


def _info(fields: _Fields) -> CameraInfo:
    """Camera of a file or a message."""
    width, height = fields.integer(WIDTH), fields.integer(HEIGHT)
    if not (width and height):
        raise fields.fault(f"the frame has {width} x {height} px; sizes start at 1")
    matrix = fields.numbers(MATRIX)
    if matrix is None:
        raise fields.fault(f"{MATRIX[0]} is missing")
    if len(matrix) != 9:
        raise fields.fault(f"{MATRIX[0]} has {len(matrix)} numbers; it needs 3 x 3")
    fx, skew, cx, zero, fy, cy, *last = matrix.tolist()
    if not (fx > 0 and fy > 0):
        raise fields.fault(
            f"{MATRIX[0]} has the focal lengths {fx:g} and {fy:g} px; both must be positive (zeros "
            "are those of a camera without calibration)"
        )
    if abs(skew) > SKEW * fx or zero != 0 or last != [0, 0, 1]:
        raise fields.fault(
            f"{MATRIX[0]} is {short(matrix.tolist())}; [fx, 0, cx, 0, fy, cy, 0, 0, 1] is valid"
        )
    coefficients = fields.numbers(DISTORTION)
    if coefficients is None:
        raise fields.fault(f"{DISTORTION[0]} is missing; five zeros are an ideal lens")
    model, distortion = _lens(fields, coefficients)
    return CameraInfo(width, height, fx, fy, cx, cy, distortion, model)


def _lens(fields: _Fields, coefficients: Floats) -> tuple[str, tuple[float, ...]]:
    """Model of the lens, and its coefficients."""
    name = fields.get(MODEL)
    if name in (None, ""):
        name = "fisheye" if fields.integer(FISHEYE, 0) else "plumb_bob"
    if name not in MODELS:
        raise fields.fault(f"{MODEL[0]} is {short(name)}; valid are: {', '.join(MODELS)}")
    model, count = MODELS[name], len(coefficients)
    if count == 14 and not coefficients[12:].any():  # OpenCV's tilted sensor, not tilted
        coefficients, count = coefficients[:12], 12
    valid = (0, 4) if model == "fisheye" else (0, 4, 5, 8, 12)
    if count not in valid:
        counts = ", ".join(str(n) for n in valid)
        raise fields.fault(
            f"{DISTORTION[0]} has {count} numbers; the model {name} takes one of {counts}"
        )
    if model != "fisheye":
        model = "rational_polynomial" if count > 5 else "plumb_bob"
    return model, tuple(coefficients.tolist())


def _plain(name: str) -> str:
    return name.replace("_", "").lower()


def _is_list(value: object) -> bool:
    return isinstance(value, np.ndarray) or (
        isinstance(value, Sequence) and not isinstance(value, str | bytes)
    )


def _number(value: Any) -> float:
    """A number; NaN if it is none. PyYAML reads 1e-05 as text."""
    try:
        return float("nan") if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        return float("nan")


def _mapping(message: object) -> Mapping[Any, Any]:
    """Fields of a message; ROS 2's are attributes, with an underscore in front."""
    if isinstance(message, Mapping):
        return message
    names = getattr(message, "__slots__", None) or getattr(message, "__dict__", {})
    fields = {str(name).lstrip("_"): getattr(message, str(name), None) for name in names}
    if not fields:
        raise AgentError(f"CameraInfo: a message or a mapping is expected, not {short(message)}.")
    return {name: value for name, value in fields.items() if value is not None}


class _Loader(yaml.SafeLoader):
    """YAML of simple values, with OpenCV's matrices as mappings; a key must not occur twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        _refuse_repeated([key.value for key, _ in node.value])
        return super().construct_mapping(node, deep)


def _refuse_repeated(keys: Sequence[Any]) -> None:
    """Refuse keys of which one occurs twice; which value is meant is not known."""
    repeated = [key for key in keys if keys.count(key) > 1]
    if repeated:
        raise ValueError(f"the key {short(repeated[0])} occurs twice")


def _matrix(loader: yaml.SafeLoader, node: yaml.Node) -> dict[Any, Any]:
    if not isinstance(node, yaml.MappingNode):
        raise ValueError("a matrix without rows, cols and data")
    return loader.construct_mapping(node, deep=True)


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _matrix)


def _yaml(text: str) -> object:
    """Content of a YAML file; OpenCV's first line, ``%YAML:1.0``, is no valid directive."""
    if re.search(r"(^|[\s\[{,:])[*&]\w", text):
        raise ValueError("aliases are not read")
    return yaml.load(re.sub(r"\A\s*%YAML:1\.0[^\n]*\n", "", text), _Loader)


def _xml(text: str) -> dict[str, object]:
    """Content of OpenCV's XML: matrices as lists, other values as text."""
    if "<!" in re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL):
        raise ValueError("declarations and entities are not read")
    values: dict[str, object] = {}
    root = ElementTree.fromstring(text)
    _refuse_repeated([item.tag for item in root])
    for item in root:
        data = item.find("data")
        content = (item.text if data is None else data.text) or ""
        values[item.tag] = content.strip() if data is None else content.split()
    return values
