"""The command line, and nothing but the command line."""

from avionics.cli.app import main

__all__ = ["main"]
