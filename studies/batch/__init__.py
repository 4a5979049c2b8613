"""Many independent jobs: on this machine's processors or on a cluster."""
