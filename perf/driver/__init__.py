"""The parts of perf/run.py: what is measured (suite), on what (subjects), how often (measure), and the outcome (summary)."""
