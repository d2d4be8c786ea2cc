"""Benchmarks: each module is one measurement, and its `main()` prints the results."""
