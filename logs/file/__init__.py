"""The file a recording is kept in: written, read, exported, mended."""
