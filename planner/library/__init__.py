"""Keeps plans in files, and turns a plan into the table that a controller follows."""
