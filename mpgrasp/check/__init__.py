"""Conformance kit: laws that the benchmark counts on, tried on a detector or a controller."""
