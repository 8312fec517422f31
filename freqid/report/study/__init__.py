"""The page of a study: one scenario at several conditions.

Read page, results, verdict, tables, pictures, figures.
"""
