"""Where storage belongs and how large: convex siting and sizing, proved by simulation."""
