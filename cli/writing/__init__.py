"""What ``aloft new`` and ``aloft blocks`` write: files of a project, and the reference as a page."""
