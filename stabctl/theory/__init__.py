"""The theory on one and two machines: swing equation, equal area, energy, phase plane, feedback, minimum time."""
