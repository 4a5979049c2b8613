"""Studies: any grid of graphs, overrides and seeds, run, kept, summed up and drawn."""
