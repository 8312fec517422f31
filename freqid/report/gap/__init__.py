"""Pages of a gap diagnosis and of two simulations compared.

Read page, tables, figures, self_test; rivals_page stands alone.
"""
