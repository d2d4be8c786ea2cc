"""Fuzzer: passes malformed files to all functions that read files, and detects faults.

``python -m tools.fuzz [KIND ...] --minutes M --seed S`` changes small valid files and passes them
to the commands that users call. `tools.fuzz.__main__` lists the results that are counted.
"""
