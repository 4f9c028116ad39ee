"""Error against time: ``python -m benchmarks --help``. The results are read in docs/accuracy.md."""
