"""The page of a point model.

Read page, tables, verdict, response_pictures.
"""
