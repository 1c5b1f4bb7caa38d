"""Files on disk: how they are read and written."""
