"""Statistics of a set of episodes: summaries, pairs, tests, the paper's orderings."""
