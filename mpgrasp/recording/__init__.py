"""Recordings of episodes: for rerun, as film, and as pictures for the report."""
