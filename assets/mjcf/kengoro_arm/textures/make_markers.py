"""Draw the two AR markers: ``python assets/mjcf/kengoro_arm/textures/make_markers.py``.

Each texture shows a whole white plate with the black square in its middle, so that the plate is one
face of a box and the size of the box fixes the size of the marker. In texture coordinates (0 to 1
over the face) the square lies between ``low`` and ``1 - low``, exactly between two pixels.

===============  ==  ============  ===========  =============  ====  =================
file             id  black square  white plate  black / plate  low   pixels
===============  ==  ============  ===========  =============  ====  =================
marker_hand.png   0  50 mm         60 mm        5/6            1/12  288 (24+240+24)
marker_can.png    1  36 mm         45 mm        4/5            1/10  300 (30+240+30)
===============  ==  ============  ===========  =============  ====  =================

On a MuJoCo box (seen by rendering with 4.0.0) the "front" of a cube texture lies on the +z face,
x right and y up as printed, and the other five faces take ``rgb1``::

    <texture name="marker_hand" type="cube" filefront="marker_hand.png" rgb1="1 1 1"/>
    <material name="marker_hand" texture="marker_hand" specular="0" reflectance="0"/>
    <geom type="box" size=".03 .03 .001" material="marker_hand"/>

A 2d texture (``type="2d" file="marker_hand.png"``) lies on +z in the same way, but also on the
others; the -z face shows it mirrored, which no detector takes for a marker.
"""

from pathlib import Path

import cv2
import numpy as np

PIXELS_PER_CELL = 40
CELLS = 6  # 4 of the code and one of black border on either side
MARKERS = {
    "marker_hand": (0, 0.050, 0.060),
    "marker_can": (1, 0.036, 0.045),
}  # id, black, plate [m]


def draw(marker_id: int, side: float, plate: float) -> np.ndarray:
    """White plate with the marker in its middle, uint8 (n, n); `side` and `plate` in metres."""
    black_px = CELLS * PIXELS_PER_CELL
    margin_px = round(black_px * (plate - side) / (2 * side))
    if not np.isclose((black_px + 2 * margin_px) / black_px, plate / side, rtol=1e-12):
        raise ValueError(f"marker {marker_id}: {plate} / {side} ends inside a pixel")
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    marker = cv2.aruco.generateImageMarker(dictionary, marker_id, black_px)
    return np.pad(marker, margin_px, constant_values=255)


def main() -> None:
    """Write both textures beside this file and print their ratios."""
    for name, (marker_id, side, plate) in MARKERS.items():
        image = draw(marker_id, side, plate)
        cv2.imwrite(
            str(Path(__file__).parent / f"{name}.png"), cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
        )
        black_px = CELLS * PIXELS_PER_CELL
        low = (image.shape[0] - black_px) / 2 / image.shape[0]
        print(
            f"{name}.png: id {marker_id}, black/plate {black_px}/{image.shape[0]} px"
            f" = {side / plate:.6f}, square from {low:.6f} to {1 - low:.6f}"
        )


if __name__ == "__main__":
    main()
