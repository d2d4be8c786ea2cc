"""Hostile files for everything that reads files: does anything crash, hang, or do what it must not?

``python -m tools.fuzz [KIND ...] --minutes M --seed S`` changes small valid files and gives them to
what users call. See `tools.fuzz.__main__` for what is counted.
"""
