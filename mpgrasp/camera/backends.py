"""Names of the camera's backends, for whoever needs them without MuJoCo."""

from __future__ import annotations

BACKENDS = ("auto", "gl", "ray")
"""OpenGL, ray casting, or "auto": OpenGL where there is one."""
