"""Plans the requests of a recording once more, in this process, and compares the ids."""
