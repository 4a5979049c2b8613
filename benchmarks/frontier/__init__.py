"""How far jumps reach in every direction, landed and planned."""
