"""Write elbow.xml: the elbow alone, with every number as in arm.xml.

Scapula and humerus are fixed in the zero posture, radius and hand to the ulna; of the tendons,
brachialis, biceps and triceps stay. Run it again when arm.xml changes; a test compares the two.
"""

import os
from pathlib import Path
from xml.etree import ElementTree

FOLDER = Path(__file__).resolve().parent
MUSCLES = ("biceps", "brachialis", "triceps")
NOTE = (
    " Written by make_elbow.py from arm.xml: the elbow alone, all else fixed at zero.\n"
    "       Attribution as in arm.xml: adapted from the Thoracoscapular shoulder model of "
    "Seth et al. (2019), CC BY 4.0,\n"
    "       and from Arm26 by the OpenSim Development Team after "
    "Holzbaur et al. (2005), CC BY 3.0. "
)
CAMERA = {
    "name": "outside",
    "pos": "0.15 -1.05 -0.20",
    "xyaxes": "1 0 0 0 0 1",
    "fovy": "45",
    "resolution": "640 480",
}
SKY = {
    "type": "skybox",
    "builtin": "flat",
    "rgb1": "0.72 0.78 0.85",
    "rgb2": "0.72 0.78 0.85",
    "width": "1",
    "height": "1",
}


def body_chain(root: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    """The bodies from the world to the one with this name."""
    for body in root.findall("body"):
        if body.get("name") == name:
            return [body]
        if chain := body_chain(body, name):
            return [body, *chain]
    return []


def position(chain: list[ElementTree.Element]) -> str:
    """Where the last body of a chain is in the zero posture, in which all frames are parallel."""
    offsets = [[float(x) for x in body.get("pos", "0 0 0").split()] for body in chain]
    return " ".join(f"{sum(axis):.10g}" for axis in zip(*offsets, strict=True))


def is_kept(element: ElementTree.Element, sites: set[str | None]) -> bool:
    """Whether a part of a body belongs to the elbow alone."""
    if element.tag == "joint":
        return element.get("name") == "elbow"
    is_tendon_point = element.tag == "site" and element.get("class") is not None
    return not is_tendon_point or element.get("name") in sites


def main() -> None:
    """Write elbow.xml beside arm.xml."""
    root = ElementTree.parse(FOLDER / "arm.xml").getroot()
    root.set("model", "kengoro_elbow")
    root.insert(0, ElementTree.Comment(NOTE))
    world, tendons, assets = root.find("worldbody"), root.find("tendon"), root.find("asset")
    assert world is not None
    assert tendons is not None
    assert assets is not None
    tendons[:] = [tendon for tendon in tendons if tendon.get("name") in MUSCLES]
    sites = {site.get("site") for site in tendons.iter("site")}
    chain = body_chain(world, "scapula")
    scapula = chain[-1]
    scapula.set("pos", position(chain))
    for body in list(scapula.iter("body")):
        body[:] = [element for element in body if is_kept(element, sites)]
    meshes = {f"{geom.get('mesh')}.obj" for geom in scapula.iter("geom")}
    assets[:] = [a for a in assets if a.tag != "mesh" or a.get("file") in meshes]
    world[:] = [ElementTree.Element("camera", CAMERA), scapula]
    assets.append(ElementTree.Element("texture", SKY))
    ElementTree.indent(root)
    beside = FOLDER / "elbow.xml.tmp"
    beside.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    os.replace(beside, FOLDER / "elbow.xml")


if __name__ == "__main__":
    main()
