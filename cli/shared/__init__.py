"""What the verbs need: printing, options, progress, running graphs, and how runs, plans and studies are made and shown."""
