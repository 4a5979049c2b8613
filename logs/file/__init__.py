"""The file that holds a recording: its format, how it is read, exported and repaired."""
