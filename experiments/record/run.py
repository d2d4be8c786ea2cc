"""`kengoro record`, with runs on reporting seeds logged."""

from __future__ import annotations

from experiments.harness.reported import log_reported
from kengoro.commands import record
from kengoro.commands.record import Args

__all__ = ["Args", "main"]


def main(args: Args) -> None:
    """Log the run, record the robot and write the study."""
    log_reported("record", [] if args.robot is None else [args.robot])
    record.main(args)
