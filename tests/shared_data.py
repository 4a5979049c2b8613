"""Logs of real robots beside the project: tests that need them skip where they are missing."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data"
"""``shared/data`` beside the project's folder; it is public at github.com/ami-iit/paper_ramadoss_2021_icra_proprioceptive-base-estimator
(iCub) and github.com/dfki-ric-underactuated-lab/double_pendulum."""
needs_icub = pytest.mark.skipif(
    not (FOLDER / "icub").is_dir(),
    reason="the iCub's logs are public: github.com/ami-iit/paper_ramadoss_2021_icra_proprioceptive-base-estimator",
)
needs_pendulum = pytest.mark.skipif(
    not (FOLDER / "double_pendulum").is_dir(),
    reason="the double pendulum's logs are public: github.com/dfki-ric-underactuated-lab/double_pendulum",
)
