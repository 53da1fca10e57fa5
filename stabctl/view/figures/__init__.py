"""Figures of results. A figure shows what a result holds; nothing is computed here."""
