"""Backends of the camera."""

BACKENDS = ("auto", "gl", "ray")
