"""Runs suites of episodes for detectors and controllers, counts what happened and writes it down."""
