"""A recorded run executed again, and compared with what it was."""
