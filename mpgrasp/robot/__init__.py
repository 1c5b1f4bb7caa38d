"""The robot as MuJoCo sees it: the arm, its hand, and what touches them."""
