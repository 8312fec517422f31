"""Figures and pages for people; no result is computed here."""
