"""What episodes cost: where their CPU time goes, and how long a study takes."""
