"""Settings of a run from the command line: read, given to whom they belong, refused where they do nothing."""
