"""The page of a simulated flight, with the aircraft drawn.

Read page, tables, figures, trims, film, three_view, outline.
"""
