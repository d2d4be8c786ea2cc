"""Experiments: the only place where the robot and the agent meet.

``python -m experiments NAME --seeds A-B --out DIR`` runs one; each writes ``summary.json``,
figures and ``report.html`` to its folder. A runner is a module with a dataclass ``Args`` (a
subclass of `experiments.harness.common.Args`) and ``main(args) -> summary``.
"""
