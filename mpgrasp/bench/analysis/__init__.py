"""What a set of episodes adds up to: summaries, pairs, tests, the paper's orderings."""
