"""Watch on a process that reads a malformed file: files that it opens, code that it runs."""

from __future__ import annotations

import os
import sys
import sysconfig
import tempfile
from pathlib import Path
from types import CodeType
from typing import Any

from mjcf_sandbox.sandbox import START

ROOT = Path(__file__).resolve().parents[2]
GENERATORS = {"dataclasses", "collections", "rosbags", "numpy", "typing", "attr", "ruamel", "tyro"}
"""Packages that execute generated code; field names in files pass their grammars first."""
RUNS = {
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.spawn",
    "os.startfile",
    "pty.spawn",
    "ctypes.dlopen",
    "pickle.find_class",
}
"""Audit events of running code that is not part of Python."""
SYSTEM = ("/proc", "/sys", "/dev/null", "/dev/urandom", "/usr/share", "/usr/lib", "/etc/mime.types")


class Watch:
    """Records what this process opens and runs, by an audit hook that stays until its end.

    Attributes:
        folder: of the current case; None between cases.
        outside: opened files outside of the folder.
        ran: descriptions of executed code.
    """

    def __init__(self) -> None:
        own = {str(ROOT), sys.prefix, sys.base_prefix, *sysconfig.get_paths().values(), *sys.path}
        self._own = tuple(os.path.realpath(folder) for folder in own if folder)
        self._sandboxes = os.path.join(os.path.realpath(tempfile.gettempdir()), "mjcf_sandbox-")
        self.folder: str | None = None
        self.outside: list[str] = []
        self.ran: list[str] = []
        sys.addaudithook(self._record)

    def begin(self, folder: Path) -> None:
        """Start to watch a case, and reset the access times of the files beside its folder.

        Args:
            folder: of the case.
        """
        self.outside, self.ran = [], []
        self._secrets = [path for path in folder.parent.iterdir() if path.is_file()]
        for secret in self._secrets:
            os.utime(secret, (1, 1))
        self.folder = os.path.realpath(folder)

    def end(self) -> None:
        """Stop watching; check the files beside the folder, and traces of executed code."""
        folder, self.folder = self.folder, None
        assert folder is not None
        self.outside += [str(path) for path in self._secrets if path.stat().st_atime != 1]
        self.ran += [str(path) for path in Path(folder).rglob("PWNED")]
        for module in list(sys.modules.values()):
            file = getattr(module, "__file__", None)
            if file and os.path.realpath(file).startswith(folder + os.sep):
                self.ran.append(f"import {file}")

    def _record(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.folder is None:
            return
        if event == "open":
            self._record_open(arguments[0])
        elif event == "subprocess.Popen":
            if START not in (arguments[1] or ()):
                self.ran.append(f"{event} {arguments[1]}")
        elif event in RUNS:
            self.ran.append(f"{event} {arguments}"[:200])
        elif event == "exec":
            self._record_exec(arguments[0])

    def _record_open(self, name: Any) -> None:
        if isinstance(name, int) or name is None:
            return
        path = os.path.realpath(os.fsdecode(name))
        allowed = (self.folder or "", *self._own, *SYSTEM)
        if not path.startswith(self._sandboxes) and not any(
            path == location or path.startswith(location.rstrip(os.sep) + os.sep)
            for location in allowed
        ):
            self.outside.append(path)

    def _record_exec(self, code: CodeType) -> None:
        file = code.co_filename
        if file.startswith("<frozen") or file.startswith(self._own):
            return
        frame = sys._getframe(2)
        while frame.f_back is not None and frame.f_globals.get("__name__") == __name__:
            frame = frame.f_back
        caller = str(frame.f_globals.get("__name__", ""))
        if caller.partition(".")[0] not in GENERATORS:
            self.ran.append(f"exec of {file} by {caller}")
