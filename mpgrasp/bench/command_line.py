"""A command-line parser whose complaints are one line like all others."""

from __future__ import annotations

import argparse
from typing import NoReturn

from mpgrasp.exceptions import ConfigError


class Parser(argparse.ArgumentParser):
    """Raises ConfigError where argparse would print its usage and exit."""

    def error(self, message: str) -> NoReturn:
        raise ConfigError(message, allowed=f"see {self.prog} --help")
