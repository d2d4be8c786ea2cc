"""Folders of valid files of which one is hostile, beside files that are nobody's business."""

from __future__ import annotations

import shutil
from pathlib import Path

from tools.fuzz.seeds import MAKERS

SECRETS = {
    "secret.xml": "<mujoco><geom size='1'/></mujoco>",
    "secret.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "secret.csv": "time,target_flexor,length_flexor,angle_elbow\n0,1,2,3\n",
}
"""Files beside a case that are nobody's business."""


class Folders:
    """Folders of one kind, made in a temporary place."""

    def __init__(self, kind: str, location: Path) -> None:
        self._kind, self._location, self._number = kind, location, 0
        self._good = location / "good"
        self._good.mkdir()
        MAKERS[kind](self._good)
        for name, text in SECRETS.items():
            (location / name).write_text(text, encoding="utf-8")

    def good(self, name: str) -> bytes:
        """A valid file."""
        return (self._good / name).read_bytes()

    def make(self, name: str, data: bytes) -> Path:
        """A new folder of valid files, in which one is replaced."""
        self._number += 1
        folder = self._location / f"case_{self._number}"
        shutil.copytree(self._good, folder)
        (folder / name).write_bytes(data)
        return folder
