"""Records -> tables, figures, pages. Reads results, computes nothing."""
