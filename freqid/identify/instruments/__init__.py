"""What the injected signals alone would have made of a manoeuvre, as instruments against noise.

Read driven, then loop_model.
"""
