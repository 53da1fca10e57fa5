"""A case and its power flow as one system of equations: assembly, operating point, derivatives."""
