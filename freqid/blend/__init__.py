"""From point models to one global model along the transition corridor; no record is fitted here.

Read line_up, pchip, line, locate, similarity, global_model, state_space; consistency and predict judge it.
"""
