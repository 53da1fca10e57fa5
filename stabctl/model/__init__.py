"""The power system as data: case, checks, network, power flow."""
