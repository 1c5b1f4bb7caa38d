"""The robot as MuJoCo sees it: the arm, its hand, and the contacts of its fingers."""
