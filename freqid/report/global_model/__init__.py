"""The page of a global model alone: its corridor, points, curves and what was predicted.

The figures along the corridor are in `kit.corridor`, which a study's page draws with too.
"""
