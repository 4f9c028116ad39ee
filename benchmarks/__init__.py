"""Benchmarks of error against time: ``python -m benchmarks --help``, docs/accuracy.md."""
