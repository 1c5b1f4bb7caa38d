"""Plays a plan: episodes in worker processes, lines as they are finished."""
