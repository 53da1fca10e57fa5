"""Transient stability of one and two machines: swing equation, equal area, energy, feedback laws, minimum time."""
