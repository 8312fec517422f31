"""Models and records as files of other tools, one format a file; nothing is identified or blended here.

Read calculation, place and tabled (a global model as scalar steps and linear tables), then the formats.
"""
