"""Reads model files, ours and those of others."""

from __future__ import annotations

import os
from pathlib import Path

import mujoco

from kengoro_env.assets import assets_root
from kengoro_env.errors import ModelError
from mjcf_sandbox.errors import UntrustedFileError
from mjcf_sandbox.mjcf import check_model


def load_spec(path: Path | str) -> mujoco.MjSpec:
    """Read a model file. A model from elsewhere may name files in its folder and in our assets.

    Args:
        path: MJCF file.

    Raises:
        ModelError: the file is missing, broken, or names files elsewhere.
    """
    path = Path(path)
    if not os.path.isfile(path):  # also for a name that is too long
        raise ModelError(f"no model file at {path}")
    try:
        if not path.resolve().is_relative_to(assets_root().resolve()):
            check_model(path, (path.parent, assets_root()))
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        reason = str(error).splitlines()[0]
        raise ModelError(f"the model file {path} is not valid MJCF: {reason}") from error
    except UntrustedFileError as error:
        raise ModelError(f"the model file {path} {error}") from error
