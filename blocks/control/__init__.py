"""Blocks that decide what the joints do."""
