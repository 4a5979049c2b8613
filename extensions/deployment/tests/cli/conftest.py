"""The fixtures of all tests of the command line."""

from tests.cli.conftest import call, call_json, counted, folder, start

__all__ = ["call", "call_json", "counted", "folder", "start"]
