"""Pages of a gap diagnosis and of two simulations compared; both are judged in gap and compare.

Read page, tables, figures; rivals_page stands alone.
"""
