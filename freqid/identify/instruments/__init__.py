"""What the injected signals alone would have made of a manoeuvre, as instruments against noise.

The regression that uses them is in regress.

Read driven, then loop_model.
"""
