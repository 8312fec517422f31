"""The page of a sealed prediction, and that of the flight held against it; both are computed elsewhere.

Read page.
"""
