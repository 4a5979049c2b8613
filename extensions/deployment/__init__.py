"""Certificates for links, copies of a graph on its machines, and the terminal view of running parts."""
