"""Siting and sizing of storage: the cheapest fleet that survives a list of contingencies."""
