"""Training data: random scenes, their labels, and the shards that hold both."""
