"""The page of stability margins under a control law, along the corridor.

Read page.
"""
