"""From point models to one global model along the transition corridor; no record is fitted here.

As a verb, ``freqid.blend(points, ...)``, it is `freqid.workflows.models.blend.blend`: its help is there.
Read line_up, pchip, line, locate, similarity, global_model, state_space; consistency and predict judge it.
"""
