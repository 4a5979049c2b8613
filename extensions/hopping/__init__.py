"""Jumps that are steered and planned in the loop: courses, stones, keyboard, gamepad."""
