"""Pages, figures and tables of results; computes no result and knows neither the simulation nor JAX.

Read kit, then the folder of one page.
"""
