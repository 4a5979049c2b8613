"""Files that people write: YAML with the place of every value, and every mistake of a file as a problem with a fix."""
