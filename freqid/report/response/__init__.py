"""The page of frequency responses.

Read page, then bode.
"""
