"""Measurements that controls read from buses."""
