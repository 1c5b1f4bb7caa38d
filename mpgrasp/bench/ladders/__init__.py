"""Ladders: one suite made harder rung by rung, until a method fails."""
