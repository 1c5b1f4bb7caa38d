"""Evaluation of detectors on real datasets: `python -m mpgrasp.evaluate cornell|jacquard PATH`."""
