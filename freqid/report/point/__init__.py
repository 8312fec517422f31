"""The page of a point model, and the sentences on its quality; the model is made in identify.

Read page, tables, verdict, sensor_tables.
"""
