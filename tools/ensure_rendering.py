"""Ensure that MuJoCo can render on this machine; install Mesa with apt-get where possible.

`make` runs it once per environment. The exit code is 0 if a picture was rendered, and otherwise 1
with a message that names the packages to install.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from ctypes.util import find_library

DEBIAN_PACKAGES = ("libegl1", "libgl1", "libgl1-mesa-dri", "libopengl0")
"""GL dispatchers and Mesa's drivers on Debian and Ubuntu; they render without a GPU."""

DRAW = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><light pos='0 0 3'/><geom size='1' rgba='1 1 1 1'/></worldbody></mujoco>"
)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 48, 64) as renderer:
    renderer.update_scene(data)
    assert renderer.render().max() > 0
"""


def backends() -> tuple[str, ...]:
    """Names of MuJoCo's GL backends to try, the preferred one first; "" for the default."""
    if not sys.platform.startswith("linux"):
        return ("",)
    chosen = os.environ.get("MUJOCO_GL")
    if chosen is not None:
        return (chosen,)
    on_display = ("glfw",) if os.environ.get("DISPLAY") else ()
    return (*on_display, "egl", "osmesa")


def draws(backend: str) -> bool:
    """Whether a separate process renders a picture that is not black.

    Args:
        backend: name of MuJoCo's GL backend; "" for the default.
    """
    environment = dict(os.environ)
    environment.pop("PYOPENGL_PLATFORM", None)
    if backend:
        environment["MUJOCO_GL"] = backend
    try:
        probe = subprocess.run(
            [sys.executable, "-c", DRAW], env=environment, capture_output=True, timeout=120
        )
    except subprocess.TimeoutExpired:
        return False
    return probe.returncode == 0


def install() -> None:
    """Install Mesa with apt-get as root, or with sudo if it needs no password; else do nothing."""
    apt_get = shutil.which("apt-get")
    if apt_get is None:
        return
    sudo: list[str] = []
    if os.geteuid() != 0:
        if shutil.which("sudo") is None:
            return
        if subprocess.run(["sudo", "-n", "true"], capture_output=True).returncode != 0:
            return
        sudo = ["sudo", "-n", "env"]
    print(f"MuJoCo cannot render: installing {' '.join(DEBIAN_PACKAGES)} with apt-get.")
    quiet = [*sudo, "env", "DEBIAN_FRONTEND=noninteractive", apt_get, "-qq"]
    subprocess.run([*quiet, "update"], stdout=subprocess.DEVNULL)
    subprocess.run(
        [*quiet, "install", "-y", "--no-install-recommends", *DEBIAN_PACKAGES],
        stdout=subprocess.DEVNULL,
    )


def main() -> int:
    """Render; if that fails, install Mesa and render again; returns the exit code."""
    if any(map(draws, backends())):
        return 0
    chosen = os.environ.get("MUJOCO_GL")
    if chosen is not None:
        print(
            f"MuJoCo cannot render with MUJOCO_GL={chosen} of the environment: unset it, or install"
            " the libraries of that backend.",
            file=sys.stderr,
        )
        return 1
    install()
    if any(map(draws, backends())):
        return 0
    missing = [name for name in ("EGL", "GL") if find_library(name) is None]
    found = f"lib{' and lib'.join(missing)} not found" if missing else "the libraries were found"
    print(
        f"MuJoCo cannot render here ({found}; tried MUJOCO_GL={', '.join(backends())}): install EGL"
        f" with Mesa's drivers, on Debian or Ubuntu `apt-get install {' '.join(DEBIAN_PACKAGES)}`.",
        file=sys.stderr,
    )
    return 1


if __name__ == "__main__":
    sys.exit(main())
