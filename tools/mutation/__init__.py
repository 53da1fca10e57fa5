"""Mutation run: one-place faults put into a copy of the tree, and the tests that notice them."""
