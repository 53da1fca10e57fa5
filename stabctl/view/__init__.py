"""What is looked at: figures, pages, the one-line diagram, and the interactive page."""
