"""Graphs as libraries of C, without Python."""
