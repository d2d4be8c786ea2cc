"""`kengoro record`, which notes runs on reporting seeds."""

from __future__ import annotations

from experiments.harness.common import log_reported
from kengoro.commands import record
from kengoro.commands.record import Args

__all__ = ["Args", "main"]


def main(args: Args) -> None:
    """Record and write the study."""
    log_reported([] if args.robot is None else [args.robot])
    record.main(args)
