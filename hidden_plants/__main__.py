"""Command line: ``python -m hidden_plants detection-limits [--machine NAME] [--recompute ID]``."""

from __future__ import annotations

import argparse
from pathlib import Path

from hidden_plants.detection_limits import TABLE, make_table
from hidden_plants.machine import ASSETS, MACHINES, load
from hidden_plants.mechanisms import MECHANISMS


def main() -> None:
    """Complete the table of detection limits; an empty table takes an hour for each machine."""
    parser = argparse.ArgumentParser(prog="python -m hidden_plants")
    parser.add_argument("command", choices=["detection-limits"])
    parser.add_argument(
        "--machine", choices=MACHINES, default="elbow", help="machine whose limits are computed"
    )
    parser.add_argument(
        "--assets", type=Path, default=ASSETS, help="folder of elbow.xml and arm.xml"
    )
    parser.add_argument(
        "--recompute",
        nargs="*",
        choices=sorted(MECHANISMS),
        default=[],
        metavar="ID",
        help="effects whose limits are computed again",
    )
    parser.add_argument("--out", type=Path, default=TABLE, help="JSON file of the table")
    args = parser.parse_args()
    make_table(load(args.machine, args.assets), args.out, tuple(args.recompute))


if __name__ == "__main__":
    main()
