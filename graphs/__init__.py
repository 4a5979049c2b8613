"""The graphs that ship with aloft, as YAML files; this package only makes them findable."""
