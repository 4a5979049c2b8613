"""Common parts of the verbs: printing, options, progress, running graphs, and runs, plans and
studies."""
