"""Benchmarks: one module a measurement, each with a `main()` that prints it."""
