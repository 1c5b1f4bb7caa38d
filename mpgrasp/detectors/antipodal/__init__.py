"""Analysis of antipodal grasps on a height map: what the oracle knows and networks learn from."""
