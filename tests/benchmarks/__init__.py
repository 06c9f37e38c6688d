"""The renderer against Mitsuba 3: `python -m tests.benchmarks`, or `make bench`. pytest collects nothing here."""
