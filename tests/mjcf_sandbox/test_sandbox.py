"""The sandbox: what happens in its worker does not reach the parent."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from mjcf_sandbox import sandbox
from mjcf_sandbox.errors import SandboxError, UntrustedFileError

LIMITS = sandbox.Limits(seconds=2.0, cpu=1, memory=256 << 20)
WORK = {
    "fine": "pass",
    "refuses": "raise UntrustedFileError('is not mine')",
    "fails": "raise TypeError('what')",
    "crashes": "os.kill(os.getpid(), signal.SIGSEGV)",
    "computes": "while True: pass",
    "fills": "bytearray(1 << 30)",
    "reports": "report_progress(0.25); time.sleep(0.1); report_progress(1.0); time.sleep(0.1)",
    "litters": "open('MUJOCO_LOG.TXT', 'w').write('x')",
}


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules for the worker, in a folder of this process's module path."""
    head = "import os, signal, time\nfrom mjcf_sandbox.errors import UntrustedFileError\n"
    head += "from mjcf_sandbox.worker import report_progress\ndef main(*arguments):\n    "
    for name, line in WORK.items():
        (tmp_path / f"work_that_{name}.py").write_text(head + line + "\n")
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("work")
def test_what_goes_well_leaves_no_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shares: list[float] = []
    sandbox.run("work_that_litters", [], LIMITS)
    sandbox.run("work_that_reports", ["a", "b"], LIMITS, shares.append)
    assert shares[-1] in (0.25, 1.0)
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


@pytest.mark.usefixtures("work")
@pytest.mark.parametrize(
    ("name", "kind", "sentence"),
    [
        ("refuses", UntrustedFileError, "is not mine"),
        ("fails", SandboxError, "makes its reader fail, or needs more than 256 MiB"),
        ("crashes", SandboxError, r"crashes its reader \(SIGSEGV\)"),
        ("computes", SandboxError, "takes longer than . s to read"),
        ("fills", SandboxError, "makes its reader fail, or needs more than 256 MiB"),
    ],
)
def test_what_goes_wrong_is_reported(name: str, kind: type[Exception], sentence: str) -> None:
    begin = time.monotonic()
    with pytest.raises(kind, match=f"^{sentence}$"):
        sandbox.run(f"work_that_{name}", [], LIMITS)
    assert time.monotonic() - begin < 60.0


def test_modules_of_the_folder_are_not_imported(tmp_path: Path) -> None:
    (tmp_path / "mujoco.py").write_text("raise SystemExit('code of the model's folder was run')")
    (tmp_path / "model.xml").write_text("<mujoco/>")
    program = (
        f"import sys; sys.path[0] = {str(Path(__file__).parents[2])!r}\n"
        "from pathlib import Path\n"
        "from mjcf_sandbox.mjcf import check_model\n"
        "check_model(Path('model.xml'), [Path()])"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
