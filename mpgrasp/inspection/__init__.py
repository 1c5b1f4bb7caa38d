"""Commands that show what detectors see and how exact they are."""
