"""The page of a study: one scenario at several conditions; single models have theirs in point.

Read page (its title and tables), results, verdict, pictures, figures, corridor.
"""
