"""Records a run while it goes on, or when it is over."""
