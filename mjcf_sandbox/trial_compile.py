"""Behind the fence: compile a model and compute its forces once."""

from __future__ import annotations

import mujoco

from mjcf_sandbox.errors import UntrustedFileError


def main(path: str) -> None:
    """Refuse a model in MuJoCo's own words, if it is not MuJoCo that breaks."""
    try:
        model = mujoco.MjSpec.from_file(path).compile()
        mujoco.mj_forward(model, mujoco.MjData(model))
    except RuntimeError as error:  # what C++ throws when it runs out of memory
        raise UntrustedFileError("asks for more memory than a model may have") from error
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise UntrustedFileError(f"does not compile: {reason}") from error
