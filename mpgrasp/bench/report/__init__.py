"""Reports of runs: HTML, Markdown and the table in the terminal."""
