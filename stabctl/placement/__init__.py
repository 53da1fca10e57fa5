"""Siting and sizing of storage: a search for the cheapest fleet that survives a list of contingencies."""
