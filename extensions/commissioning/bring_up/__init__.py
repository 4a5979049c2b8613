"""The guided way from a robot on the bench to one whose wiring is known: one step a function."""
