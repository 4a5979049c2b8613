"""The kino-dynamic planner: from a task to a checked plan of the whole body's motion."""
