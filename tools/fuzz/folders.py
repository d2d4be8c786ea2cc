"""Folders of valid files of which one is malformed, beside files that must not be read."""

from __future__ import annotations

import shutil
from pathlib import Path

from tools.fuzz.seeds import MAKERS

SECRETS = {
    "secret.xml": "<mujoco><geom size='1'/></mujoco>",
    "secret.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "secret.csv": "time,target_flexor,length_flexor,angle_elbow\n0,1,2,3\n",
}
"""Files beside the folder of a case; a command that reads one is at fault."""


class Folders:
    """Makes the folders of the cases of one kind.

    Args:
        kind: a key of `MAKERS`.
        location: temporary folder in which they are made.
    """

    def __init__(self, kind: str, location: Path) -> None:
        self._kind, self._location, self._number = kind, location, 0
        self._good = location / "good"
        self._good.mkdir()
        MAKERS[kind](self._good)
        for name, text in SECRETS.items():
            (location / name).write_text(text, encoding="utf-8")

    def good(self, name: str) -> bytes:
        """Bytes of a valid file, by its path in the folder."""
        return (self._good / name).read_bytes()

    def make(self, name: str, data: bytes) -> Path:
        """Make a folder of valid files in which one is replaced.

        Args:
            name: path of the file in the folder.
            data: its new bytes.

        Returns:
            The folder.
        """
        self._number += 1
        folder = self._location / f"case_{self._number}"
        shutil.copytree(self._good, folder)
        (folder / name).write_bytes(data)
        return folder
