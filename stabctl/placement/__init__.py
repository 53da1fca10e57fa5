"""Where storage belongs and how large it should be."""
