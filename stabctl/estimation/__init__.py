"""Estimation of rotor speeds from noisy, delayed and lost PMU phasors, and storage control with estimated speeds."""
