"""The page of frequency responses; they are estimated in identify/response.

Read page.
"""
