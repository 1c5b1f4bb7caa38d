"""Meshes in the place of a suite's own objects."""
