"""The page of a quick look: the verdict, inputs as designed, commanded and achieved, rates and parameters.

Read page.
"""
