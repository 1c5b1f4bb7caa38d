"""The part of the table where things are placed, looked for and grasped."""

from __future__ import annotations

WORKSPACE_CENTRE = (0.5, 0.0)
"""World x, y of its middle [m]."""
WORKSPACE_REACH = 0.34
"""Half the edge of the square workspace about its centre, half of Table I's 0.68 m grid [m]."""
