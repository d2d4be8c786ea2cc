"""Work of a sandbox worker: compile a model and compute its forces once."""

from __future__ import annotations

import mujoco

from mjcf_sandbox.errors import UntrustedFileError


def main(path: str) -> None:
    """Compile a model.

    Args:
        path: absolute path of an MJCF file.

    Raises:
        UntrustedFileError: the model does not compile, with MuJoCo's message.
    """
    try:
        model = mujoco.MjSpec.from_file(path).compile()
        mujoco.mj_forward(model, mujoco.MjData(model))
    except RuntimeError as error:  # what C++ throws when it runs out of memory
        raise UntrustedFileError("asks for more memory than a model may have") from error
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise UntrustedFileError(f"does not compile: {reason}") from error
