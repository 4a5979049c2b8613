"""Studies of the extension `lab`."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
"""Logs of real robots that others made public, beside the project's folder."""
