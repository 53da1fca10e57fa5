"""Speeds from noisy, late and missing PMU phasors, and the storage controllers that live on them."""
