"""Experiments: they reproduce the paper and evaluate the packages, from a checkout.

``python -m experiments NAME --seeds A-B --out DIR`` runs one. Most write ``summary.json``, figures
and ``report.html`` to their folder.

An experiment is a folder with a module ``run``, which has a dataclass ``Args`` of its options and a
function ``main(args)``, and an entry in `experiments.__main__.RUNNERS`. Most experiments declare
conditions on robots as an `Experiment`; `experiments.harness.experiment` explains how to write one.
"""
