"""Work of a sandbox worker: compile a model and compute its forces once."""

from __future__ import annotations

from pathlib import Path

import mujoco

from mjcf_sandbox.errors import UntrustedFileError
from mjcf_sandbox.mjcf import included_names

SUFFIXES = (".xml", ".urdf")
"""Suffixes by which MuJoCo knows how to read a file."""


def main(path: str) -> None:
    """Compile a model.

    Args:
        path: absolute path of an MJCF file.

    Raises:
        UntrustedFileError: the model does not compile, with MuJoCo's message.
    """
    try:
        model = read_model(Path(path)).compile()
        mujoco.mj_forward(model, mujoco.MjData(model))
    except RuntimeError as error:  # what C++ throws when it runs out of memory
        raise UntrustedFileError("asks for more memory than a model may have") from error
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise UntrustedFileError(f"does not compile: {reason}") from error


def read_model(path: Path) -> mujoco.MjSpec:
    """Read a model file of any suffix; MuJoCo itself reads only those of `SUFFIXES`.

    Args:
        path: MJCF file; its includes lie in or below its folder, by their names in the file.

    Raises:
        ValueError: the file is not valid MJCF.
    """
    if path.suffix in SUFFIXES:
        return mujoco.MjSpec.from_file(str(path))
    include = {
        name: (path.parent / name).read_bytes()
        for name in included_names(path)
        if (path.parent / name).is_file()
    }
    spec = mujoco.MjSpec.from_string(path.read_text(encoding="utf-8-sig"), include=include)
    spec.modelfiledir = str(path.parent.absolute())
    return spec
