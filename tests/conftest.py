"""Settings for all tests."""

from hypothesis import settings

# The same examples every time: what passes here passes there. No deadline: machines are shared.
settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")
