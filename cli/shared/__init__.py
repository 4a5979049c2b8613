"""What several verbs need: printing, options, completion, progress, and where graphs run."""
