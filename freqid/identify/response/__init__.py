"""Frequency responses of what was flown; parametric models are in model.

Read frequency_response, injected_lines, local_response; window_response is for sweeps.
"""
