"""Plans as data: the files they are kept in, and the table a controller follows."""
