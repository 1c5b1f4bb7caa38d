"""Guards of every run: what a detector or a controller returns is checked before it counts."""
