"""General blocks on plain vectors."""
