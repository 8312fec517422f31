"""Frequency responses of what was flown, without a model of the aircraft; parametric models are in model.

Read frequency_response, injected_lines, local_response; swept_lines.
"""
