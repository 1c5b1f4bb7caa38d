"""Names of the camera's backends."""

from __future__ import annotations

BACKENDS = ("auto", "gl", "ray")
"""OpenGL where there is one, OpenGL, or rays."""
