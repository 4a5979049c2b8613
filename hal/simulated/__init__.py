"""The robot simulated by MuJoCo."""
