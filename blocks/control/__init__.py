"""Blocks that compute what the joints do: targets, models, torques and joint commands."""
