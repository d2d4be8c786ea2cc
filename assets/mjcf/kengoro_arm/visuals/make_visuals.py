"""Write the meshes that show the robot: ``python assets/mjcf/kengoro_arm/visuals/make_visuals.py``.

One mesh for each colour of a body or of a part of it, in the body's frame, with normals. They are
only seen: arm.xml gives them no mass and no contact. Points of wires are read from arm.xml. Run
this again when one of them moves; a test compares its meshes with those in ../meshes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import hand
import head
import limb
import trunk
from parts import FOLDER
from shapes import Shape, with_normals

MAKERS = (
    *(trunk.thorax, head.head, head.jaw, limb.clavicle, limb.scapula, limb.humerus, limb.ulna),
    *(limb.radius, hand.hand, hand.fingers_proximal, hand.fingers_distal),
    *(hand.thumb_proximal, hand.thumb_distal),
)
"""A function for each body or part."""


def as_obj(shape: Shape) -> str:
    """A shape as the text of an OBJ file: vertices to 0.01 mm, normals, faces."""
    vertices, normals, faces = with_normals(shape)
    lines = [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in vertices]
    lines += [f"vn {x:.2f} {y:.2f} {z:.2f}" for x, y, z in normals]
    lines += ["f " + " ".join(f"{i}//{i}" for i in face) for face in faces + 1]
    return "\n".join(lines).replace("-0.00000", "0.00000").replace("-0.00 ", "0.00 ") + "\n"


def main(folder: Path = FOLDER / "meshes") -> None:
    """Write the meshes into a folder, and remove others that lie there."""
    folder.mkdir(exist_ok=True)
    for old in folder.glob("*.obj"):
        old.unlink()
    for maker in MAKERS:
        for name, shape in maker().meshes().items():
            (folder / f"{name}.obj").write_text(as_obj(shape), encoding="utf-8")


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:]))
