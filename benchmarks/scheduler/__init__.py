"""The cost of the runtime beside a hand-written loop and other frameworks."""
