"""The commands of `python -m mpgrasp.bench`: one verb, one module."""
