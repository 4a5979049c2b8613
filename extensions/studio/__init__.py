"""The live page, the page of a diagram, drawn diagrams, and the language server."""
